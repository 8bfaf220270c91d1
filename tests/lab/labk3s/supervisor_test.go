package main

import (
	"io"
	"net/http"
	"testing"
	"time"
)

// lateBody is a request's body that is sent when its answer has begun, or
// after a while without one.
type lateBody struct{ answered <-chan struct{} }

func (b lateBody) Read(p []byte) (int, error) {
	select {
	case <-b.answered:
	case <-time.After(500 * time.Millisecond):
	}
	return copy(p, "{}"), io.EOF
}

// The API server refuses before it has read what was sent. Its answer has to
// end, also for a client that sends nothing more once it hears of it.
func TestARefusalEndsThoughItsRequestWasNotRead(t *testing.T) {
	s, cert := newSupervisor(t)
	api := listen(t, http.HandlerFunc(func(w http.ResponseWriter, _ *http.Request) {
		http.Error(w, "forbidden", http.StatusForbidden)
	}), cert)
	proxy, err := s.apiProxy(api.URL)
	if err != nil {
		t.Fatal(err)
	}
	server := listen(t, proxy, cert)
	client := server.Client()
	client.Timeout = 10 * time.Second
	answered := make(chan struct{})
	request, err := http.NewRequest(http.MethodPost, server.URL, lateBody{answered})
	if err != nil {
		t.Fatal(err)
	}
	request.ContentLength = 2
	answer, err := client.Do(request)
	if err != nil {
		t.Fatal(err)
	}
	close(answered)
	defer answer.Body.Close()
	text, err := io.ReadAll(answer.Body)
	if err != nil || string(text) != "forbidden\n" || answer.ProtoMajor != 2 {
		t.Fatalf("%s %s: %q, %v", answer.Proto, answer.Status, text, err)
	}
}
