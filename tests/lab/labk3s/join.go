package main

import (
	"bytes"
	"context"
	"crypto/tls"
	"crypto/x509"
	"errors"
	"fmt"
	"io"
	"net"
	"net/http"
	"strings"
	"time"
)

// joiner talks to a supervisor with a token.
type joiner struct {
	url    string
	token  token
	ca     []byte
	client *http.Client
	tls    *tls.Config // the client's
}

// refusal is a supervisor's "no", which no waiting will change by itself.
type refusal struct {
	status int
	text   string
}

func (r *refusal) Error() string { return r.text }

func refused(err error) bool {
	var no *refusal
	return errors.As(err, &no)
}

// newJoiner learns the cluster's CA and, where the token names it, verifies
// it. A short token trusts whom it meets first, as k3s's does. An agent hands
// in its load balancer, to hear why its server cannot be reached.
func newJoiner(ctx context.Context, url string, t token, lb *loadBalancer) (*joiner, error) {
	transport := func(config *tls.Config) *http.Transport {
		// Each attempt may meet another server, so none keeps its connection.
		t := &http.Transport{TLSClientConfig: config, DisableKeepAlives: true}
		if lb != nil {
			t.DialContext = func(ctx context.Context, _, _ string) (net.Conn, error) { return lb.dial(ctx) }
		}
		return t
	}
	// What comes back is checked below.
	trusting := transport(&tls.Config{InsecureSkipVerify: true})
	j := &joiner{url: url, client: &http.Client{Timeout: 10 * time.Second, Transport: trusting}}
	ca, err := j.do(ctx, http.MethodGet, "/cacerts", nil, nil)
	if err != nil {
		return nil, fmt.Errorf("failed to get CA certs: %w", err)
	}
	if err := t.verifyCA(ca); err != nil {
		return nil, &refusal{http.StatusUnauthorized, "failed to validate token: " + err.Error()}
	}
	roots := x509.NewCertPool()
	if !roots.AppendCertsFromPEM(ca) {
		return nil, fmt.Errorf("failed to get CA certs: no certificate from %s", url)
	}
	config := &tls.Config{RootCAs: roots, MinVersion: tls.VersionTLS12}
	client := &http.Client{Timeout: 30 * time.Second, Transport: transport(config)}
	return &joiner{url: url, token: t, ca: ca, client: client, tls: config}, nil
}

// identify shows the kubelet's certificate of an earlier start, too. A node
// that the cluster knows needs its token no more, so that may have ended.
func (j *joiner) identify(base string) {
	if cert, err := tls.LoadX509KeyPair(base+".crt", base+".key"); err == nil {
		j.tls.Certificates = []tls.Certificate{cert}
	}
}

func (j *joiner) get(ctx context.Context, path string) ([]byte, error) {
	return j.do(ctx, http.MethodGet, path, nil, nil)
}

func (j *joiner) do(ctx context.Context, method, path string, body []byte, header map[string]string) ([]byte, error) {
	request, err := http.NewRequestWithContext(ctx, method, j.url+path, bytes.NewReader(body))
	if err != nil {
		return nil, err
	}
	if j.token.bootstrap() {
		request.Header.Set("Authorization", "Bearer "+j.token.secret)
	} else if j.token.secret != "" {
		request.SetBasicAuth(j.token.user, j.token.secret)
	}
	for name, value := range header {
		request.Header.Set(name, value)
	}
	response, err := j.client.Do(request)
	if err != nil {
		return nil, err
	}
	defer response.Body.Close()
	content, err := io.ReadAll(io.LimitReader(response.Body, 1<<22))
	if err != nil {
		return nil, err
	}
	if response.StatusCode == http.StatusOK {
		return content, nil
	}
	text := fmt.Sprintf("%s%s: %s: %s", j.url, path, response.Status, strings.TrimSpace(string(content)))
	if response.StatusCode == http.StatusUnauthorized || response.StatusCode == http.StatusForbidden {
		return nil, &refusal{response.StatusCode, text}
	}
	return nil, errors.New(text)
}

// sign sends a certificate request for this node and returns the certificate.
func (j *joiner) sign(ctx context.Context, path, base, node, password, ip string) error {
	request, err := newCSR(base)
	if err != nil {
		return err
	}
	header := map[string]string{nodeNameHeader: node, nodePasswordHeader: password, nodeIPHeader: ip}
	cert, err := j.do(ctx, http.MethodPost, path, request, header)
	// The cluster does not know the node of the certificate: it was deleted.
	var no *refusal
	if errors.As(err, &no) && no.status == http.StatusUnauthorized && len(j.tls.Certificates) > 0 {
		j.tls.Certificates = nil
		cert, err = j.do(ctx, http.MethodPost, path, request, header)
	}
	if err != nil {
		return err
	}
	_, err = writeFile(base+".crt", cert, 0o644)
	return err
}
