package main

import (
	"bytes"
	"context"
	"crypto/tls"
	"encoding/json"
	"net/http"
	"net/http/httptest"
	"strings"
	"testing"
	"time"

	authenticationv1 "k8s.io/api/authentication/v1"
	corev1 "k8s.io/api/core/v1"
	metav1 "k8s.io/apimachinery/pkg/apis/meta/v1"
	"k8s.io/client-go/kubernetes"
	"k8s.io/client-go/rest"
)

// fakeAPI keeps objects by their path, and knows which bearer tokens hold.
type fakeAPI struct {
	objects map[string]any
	bearers map[string]bool
}

func (f *fakeAPI) ServeHTTP(w http.ResponseWriter, r *http.Request) {
	w.Header().Set("Content-Type", "application/json")
	if strings.HasSuffix(r.URL.Path, "/tokenreviews") {
		var review authenticationv1.TokenReview
		_ = json.NewDecoder(r.Body).Decode(&review)
		if f.bearers[review.Spec.Token] {
			review.Status.Authenticated = true
			review.Status.User.Groups = []string{"system:bootstrappers", joiners}
		}
		_ = json.NewEncoder(w).Encode(review)
		return
	}
	if r.Method == http.MethodPost {
		var secret corev1.Secret
		_ = json.NewDecoder(r.Body).Decode(&secret)
		f.objects[r.URL.Path+"/"+secret.Name] = &secret
		_ = json.NewEncoder(w).Encode(secret)
		return
	}
	if r.Method == http.MethodGet && strings.HasSuffix(r.URL.Path, "/secrets") {
		list := corev1.SecretList{}
		for _, one := range f.objects {
			if secret, ok := one.(*corev1.Secret); ok && r.URL.Query().Get("fieldSelector") == "type="+string(secret.Type) {
				list.Items = append(list.Items, *secret)
			}
		}
		_ = json.NewEncoder(w).Encode(list)
		return
	}
	found, ok := f.objects[r.URL.Path]
	if !ok {
		w.WriteHeader(http.StatusNotFound)
		_ = json.NewEncoder(w).Encode(metav1.Status{Status: "Failure", Reason: metav1.StatusReasonNotFound, Code: http.StatusNotFound})
		return
	}
	if r.Method == http.MethodDelete {
		delete(f.objects, r.URL.Path)
	}
	_ = json.NewEncoder(w).Encode(found)
}

func startAPIFake(t *testing.T) (*fakeAPI, kubernetes.Interface) {
	t.Helper()
	api := &fakeAPI{objects: map[string]any{}, bearers: map[string]bool{}}
	server := httptest.NewServer(api)
	t.Cleanup(server.Close)
	kube, err := kubernetes.NewForConfig(&rest.Config{
		Host: server.URL, ContentConfig: rest.ContentConfig{ContentType: "application/json", AcceptContentTypes: "application/json"},
	})
	if err != nil {
		t.Fatal(err)
	}
	return api, kube
}

const (
	agents   = "agents-secret"
	good     = "abcdef.0123456789abcdef"
	certPath = "/v1-k3s/client-kubelet.crt"
	nodePath = "/api/v1/nodes/robot2"
)

// site is a supervisor that listens, and a robot's directory.
type site struct {
	*fakeAPI
	url  string
	ca   []byte
	base string
}

// newSupervisor is one that does not listen yet, and the certificate that it shows.
func newSupervisor(t *testing.T) (*supervisor, tls.Certificate) {
	t.Helper()
	c := &config{dataDir: dataDir(t.TempDir()), NodeName: "edge1", NodeIP: "127.0.0.1"}
	cas, err := ensureCAs(c.dataDir)
	if err != nil {
		t.Fatal(err)
	}
	if err := serverLeaves(c, cas); err != nil {
		t.Fatal(err)
	}
	own := c.dataDir.tls("serving-kube-apiserver")
	cert, err := tls.LoadX509KeyPair(own+".crt", own+".key")
	if err != nil {
		t.Fatal(err)
	}
	return &supervisor{config: c, cas: cas, serverToken: "servers-secret", agentToken: agents}, cert
}

// listen has a handler answer by HTTP/2 with this certificate.
func listen(t *testing.T, handler http.Handler, cert tls.Certificate) *httptest.Server {
	t.Helper()
	server := httptest.NewUnstartedServer(handler)
	server.EnableHTTP2 = true
	server.TLS = &tls.Config{Certificates: []tls.Certificate{cert}, ClientAuth: tls.RequestClientCert}
	server.StartTLS()
	t.Cleanup(server.Close)
	return server
}

func startSite(t *testing.T) *site {
	t.Helper()
	s, cert := newSupervisor(t)
	api, kube := startAPIFake(t)
	s.kube = kube
	s.apiReady.Store(true)
	handler, err := s.handler()
	if err != nil {
		t.Fatal(err)
	}
	server := listen(t, handler, cert)
	return &site{api, server.URL, s.cas["server-ca"].pem, s.config.dataDir.agent("client-kubelet")}
}

// join is what the agent of robot2 does at each of its starts.
func (s *site) join(t *testing.T, given, name string) error {
	t.Helper()
	parsed, err := parseToken(given, "node")
	if err != nil {
		t.Fatal(err)
	}
	j, err := newJoiner(context.Background(), s.url, parsed, nil)
	if err != nil {
		t.Fatal(err)
	}
	j.identify(s.base)
	return j.sign(context.Background(), certPath, s.base, name, "password", "192.0.2.2")
}

func (s *site) addNode() { s.objects[nodePath] = node("robot2", "", "192.0.2.2") }

func TestABootstrapTokenIsForTheJoinAlone(t *testing.T) {
	s := startSite(t)
	full := "K10" + hashCA(s.ca) + "::" + good
	if err := s.join(t, full, "robot2"); !refused(err) {
		t.Fatalf("a token that nobody made: %v", err)
	}
	s.bearers[good] = true
	if err := s.join(t, full, "robot2"); err != nil {
		t.Fatalf("with its token: %v", err)
	}
	s.addNode()
	s.bearers = map[string]bool{}
	if err := s.join(t, full, "robot2"); err != nil {
		t.Fatalf("a later start, when the token has ended: %v", err)
	}
	if err := s.join(t, full, "robot1"); err == nil || !strings.Contains(err.Error(), errOtherNode.Error()) {
		t.Fatalf("by its certificate as another node: %v", err)
	}
	delete(s.objects, nodePath)
	if err := s.join(t, full, "robot2"); !refused(err) {
		t.Fatalf("when its Node was deleted: %v", err)
	}
	s.bearers[good] = true
	if err := s.join(t, full, "robot2"); err != nil {
		t.Fatalf("the same with a token that holds: %v", err)
	}
}

func TestWhatLetsInToWhat(t *testing.T) {
	s := startSite(t)
	s.bearers[good] = true
	for _, test := range []struct {
		given, path string
		ok          bool
	}{
		{agents, "/v1-k3s/client-ca.crt", true},
		{good, "/v1-k3s/client-ca.crt", true},
		{"zzzzzz.0123456789abcdef", "/v1-k3s/client-ca.crt", false},
		{"other", "/v1-k3s/client-ca.crt", false},
		{good, "/v1-k3s/server-bootstrap", false}, // joins no server
		{agents, "/v1-k3s/server-bootstrap", false},
	} {
		parsed, err := parseToken(test.given, "node")
		if err != nil {
			t.Fatal(err)
		}
		j, err := newJoiner(context.Background(), s.url, parsed, nil)
		if err != nil {
			t.Fatal(err)
		}
		if _, err := j.get(context.Background(), test.path); (err == nil) != test.ok {
			t.Errorf("%s with %s: %v", test.path, test.given, err)
		}
	}
}

func TestTokenCommand(t *testing.T) {
	api, kube := startAPIFake(t)
	ca := []byte("-----BEGIN CERTIFICATE-----\n")
	run := func(args ...string) string {
		t.Helper()
		var out bytes.Buffer
		if err := runToken(context.Background(), kube, ca, args, &out); err != nil {
			t.Fatalf("%v: %v", args, err)
		}
		return strings.TrimSpace(out.String())
	}
	made, err := parseToken(run("create", "--ttl", "1h", "--description", "robot2"), "node")
	if err != nil || !made.bootstrap() || made.verifyCA(ca) != nil {
		t.Fatalf("made %+v: %v", made, err)
	}
	id, secret, _ := strings.Cut(made.secret, ".")
	kept := func(id string) *corev1.Secret {
		found, _ := api.objects["/api/v1/namespaces/kube-system/secrets/bootstrap-token-"+id].(*corev1.Secret)
		return found
	}
	there := kept(id)
	if there == nil || string(there.Data["token-secret"]) != secret || string(there.Data["usage-bootstrap-authentication"]) != "true" {
		t.Fatalf("kept %v", api.objects)
	}
	ends, err := time.Parse(time.RFC3339, string(there.Data["expiration"]))
	if left := time.Until(ends); err != nil || left < 58*time.Minute || left > time.Hour {
		t.Errorf("it ends at %s: %v", ends, err)
	}
	if got := run("list", "-o", "json"); !strings.Contains(got, `"description":"robot2"`) || !strings.Contains(got, made.secret) {
		t.Errorf("listed %s", got)
	}
	run("delete", id)
	if got := run("list", "-o", "json"); got != "[]" {
		t.Errorf("after its deletion: %s", got)
	}
	_, endless, _ := strings.Cut(run("create", "--ttl", "0"), "::")
	if _, ends := kept(endless[:6]).Data["expiration"]; ends {
		t.Error("without a ttl it ends")
	}
	var out bytes.Buffer
	for _, bad := range [][]string{nil, {"rotate"}, {"list"}, {"delete"}, {"delete", "nobody"}, {"create", "--groups", "x"}} {
		if err := runToken(context.Background(), kube, ca, bad, &out); err == nil {
			t.Errorf("%v was done", bad)
		}
	}
}
