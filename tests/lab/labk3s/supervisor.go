package main

import (
	"bytes"
	"context"
	"crypto/tls"
	"crypto/x509"
	"errors"
	"io"
	"log"
	"net"
	"net/http"
	"net/http/httputil"
	"net/url"
	"os"
	"slices"
	"strings"
	"sync/atomic"
	"syscall"
	"time"

	authenticationv1 "k8s.io/api/authentication/v1"
	corev1 "k8s.io/api/core/v1"
	apierrors "k8s.io/apimachinery/pkg/api/errors"
	metav1 "k8s.io/apimachinery/pkg/apis/meta/v1"
	"k8s.io/client-go/kubernetes"
	bootstrapapi "k8s.io/cluster-bootstrap/token/api"
	bootstraputil "k8s.io/cluster-bootstrap/token/util"

	"golang.org/x/sys/unix"
)

const (
	apiPort = "6443"
	// The API server sits on the same port of another loopback address: the
	// Service `kubernetes` then gets the endpoint <node>:6443, as with k3s,
	// and everybody who asks there meets the supervisor first.
	apiserverIP  = "127.0.0.2"
	apiserverURL = "https://" + apiserverIP + ":" + apiPort
)

// supervisor is what answers on port 6443: nodes join through it, and all
// other requests are handed on to the API server.
type supervisor struct {
	config      *config
	cas         map[string]*authority
	serverToken string // secrets alone
	agentToken  string
	kube        kubernetes.Interface
	apiReady    atomic.Bool
	rotated     atomic.Pointer[string] // the servers' secret, once it was made anew
}

const (
	nodeNameHeader     = "K3s-Node-Name"
	nodePasswordHeader = "K3s-Node-Password"
	nodeIPHeader       = "K3s-Node-Ip"
)

var errNodePassword = errors.New("Node password rejected, duplicate hostname or contents of '" + nodePasswordFile +
	"' may not match server node-passwd entry, try enabling a unique node name with the --node-name flag")

func (s *supervisor) serve(ctx context.Context) error {
	handler, err := s.handler()
	if err != nil {
		return err
	}
	clientCAs := x509.NewCertPool()
	clientCAs.AddCert(s.cas["client-ca"].cert)
	base := s.config.dataDir.tls("serving-kube-apiserver")
	cert, err := tls.LoadX509KeyPair(base+".crt", base+".key")
	if err != nil {
		return err
	}
	server := &http.Server{
		Handler: handler,
		TLSConfig: &tls.Config{
			MinVersion:   tls.VersionTLS12,
			Certificates: []tls.Certificate{cert},
			// Asked for but not demanded: tokens are a way in, too. The
			// proxy verifies what was presented.
			ClientAuth: tls.RequestClientCert,
			ClientCAs:  clientCAs,
			NextProtos: []string{"h2", "http/1.1"},
		},
		// Every scan and every broken handshake would be a line otherwise.
		ErrorLog:          log.New(io.Discard, "", 0),
		ReadHeaderTimeout: 30 * time.Second,
	}
	// The API server has the same port on another address, so both share it.
	listen := net.ListenConfig{Control: func(_, _ string, conn syscall.RawConn) error {
		var failed error
		err := conn.Control(func(fd uintptr) {
			failed = unix.SetsockoptInt(int(fd), unix.SOL_SOCKET, unix.SO_REUSEPORT, 1)
		})
		return errors.Join(err, failed)
	}}
	var listener net.Listener
	err = poll(ctx, 100*time.Millisecond, 15*time.Second, func() (bool, error) {
		listener, err = listen.Listen(ctx, "tcp4", "0.0.0.0:"+apiPort)
		return err == nil, err
	})
	if err != nil {
		return err
	}
	go func() {
		<-ctx.Done()
		server.Close()
	}()
	go func() {
		if err := server.ServeTLS(notForAPIServer{listener}, "", ""); !errors.Is(err, http.ErrServerClosed) {
			logf("error", "supervisor: %v", err)
		}
	}()
	return nil
}

// notForAPIServer turns away who wants the API server itself. As long as that
// does not listen, the kernel gives its connections to the listener on all
// addresses, and a proxy that talks to itself would go on doing so.
type notForAPIServer struct{ net.Listener }

func (l notForAPIServer) Accept() (net.Conn, error) {
	for {
		conn, err := l.Listener.Accept()
		if err != nil {
			return nil, err
		}
		if local, ok := conn.LocalAddr().(*net.TCPAddr); !ok || local.IP.String() != apiserverIP {
			return conn, nil
		}
		conn.Close()
	}
}

func (s *supervisor) handler() (http.Handler, error) {
	proxy, err := s.apiProxy(apiserverURL)
	if err != nil {
		return nil, err
	}
	mux := http.NewServeMux()
	mux.HandleFunc("GET /cacerts", s.serveCA("server-ca"))
	node := func(h http.HandlerFunc) http.HandlerFunc { return s.authorized(h, "node", "server") }
	server := func(h http.HandlerFunc) http.HandlerFunc { return s.authorized(h, "server") }
	mux.HandleFunc("GET /v1-k3s/client-ca.crt", node(s.serveCA("client-ca")))
	mux.HandleFunc("POST /v1-k3s/serving-kubelet.crt", node(s.forNode(s.sign("server-ca", func(name, ip string) leaf {
		return leaf{name: name, names: []string{name, "localhost", "127.0.0.1", ip}, server: true}
	}))))
	mux.HandleFunc("POST /v1-k3s/client-kubelet.crt", node(s.forNode(s.sign("client-ca", func(name, _ string) leaf {
		return leaf{name: "system:node:" + name, groups: []string{"system:nodes"}, client: true}
	}))))
	// These two are of no node: k3s asks for no name or password either.
	mux.HandleFunc("POST /v1-k3s/client-kube-proxy.crt", node(s.sign("client-ca", func(string, string) leaf {
		return leaf{name: "system:kube-proxy", client: true}
	})))
	mux.HandleFunc("POST /v1-k3s/client-k3s-controller.crt", node(s.sign("client-ca", func(string, string) leaf {
		return leaf{name: "system:k3s-controller", client: true}
	})))
	// What servers share would be here: who has their token may ask for it.
	mux.HandleFunc("GET /v1-k3s/server-bootstrap", server(func(http.ResponseWriter, *http.Request) {}))
	mux.HandleFunc("PUT /v1-k3s/token", server(s.serveTokenRotation))
	mux.Handle("/v1-k3s/", http.NotFoundHandler())
	mux.Handle("/", proxy)
	return mux, nil
}

// apiProxy hands requests on to the API server. A client certificate cannot
// travel through, so its verified name does, by the API server's own means
// for that: request headers, believed from the holder of the proxy's
// certificate only.
func (s *supervisor) apiProxy(api string) (http.Handler, error) {
	target, err := url.Parse(api)
	if err != nil {
		return nil, err
	}
	roots := x509.NewCertPool()
	roots.AddCert(s.cas["server-ca"].cert)
	base := s.config.dataDir.tls("client-auth-proxy")
	cert, err := tls.LoadX509KeyPair(base+".crt", base+".key")
	if err != nil {
		return nil, err
	}
	transportFor := func(h2 bool, certs ...tls.Certificate) http.RoundTripper {
		t := &http.Transport{
			TLSClientConfig:     &tls.Config{RootCAs: roots, Certificates: certs, MinVersion: tls.VersionTLS12},
			MaxIdleConnsPerHost: 25,
			IdleConnTimeout:     90 * time.Second,
			ForceAttemptHTTP2:   h2,
			// The client decides about compression, not the proxy.
			DisableCompression: true,
		}
		if !h2 {
			t.TLSNextProto = map[string]func(string, *tls.Conn) http.RoundTripper{}
		}
		return t
	}
	// Per kind of connection: with and without a verified name, and HTTP/1.1
	// for the upgrades of exec, attach and port-forward.
	transports := map[[2]bool]http.RoundTripper{}
	for _, named := range []bool{true, false} {
		for _, upgrade := range []bool{true, false} {
			var certs []tls.Certificate
			if named {
				certs = []tls.Certificate{cert}
			}
			transports[[2]bool{named, upgrade}] = transportFor(!upgrade, certs...)
		}
	}
	proxy := &httputil.ReverseProxy{
		Rewrite: func(r *httputil.ProxyRequest) {
			r.SetURL(target)
			r.Out.Host = r.In.Host
			for name := range r.Out.Header {
				if strings.HasPrefix(name, "X-Remote-") {
					r.Out.Header.Del(name)
				}
			}
			if user := s.peerUser(r.In); user != nil {
				r.Out.Header.Set("X-Remote-User", user.Subject.CommonName)
				for _, group := range user.Subject.Organization {
					r.Out.Header.Add("X-Remote-Group", group)
				}
			}
		},
		Transport: roundTripper(func(r *http.Request) (*http.Response, error) {
			named := r.Header.Get("X-Remote-User") != ""
			return transports[[2]bool{named, r.Header.Get("Upgrade") != ""}].RoundTrip(r)
		}),
		FlushInterval: -1, // watches
		ErrorLog:      log.New(io.Discard, "", 0),
		ErrorHandler: func(w http.ResponseWriter, r *http.Request, err error) {
			if r.Context().Err() == nil {
				http.Error(w, "apiserver not ready: "+err.Error(), http.StatusServiceUnavailable)
			}
		},
	}
	return whole(proxy), nil
}

// whole hands a request on once all of its body is here. A client that hears
// that it is refused sends no more of it, and a proxy that waits for the rest
// never ends the answer: both of them would wait for ever.
func whole(next http.Handler) http.Handler {
	return http.HandlerFunc(func(w http.ResponseWriter, r *http.Request) {
		body, err := io.ReadAll(r.Body)
		if err != nil {
			panic(http.ErrAbortHandler) // the client is gone
		}
		r.Body = io.NopCloser(bytes.NewReader(body))
		next.ServeHTTP(w, r)
	})
}

type roundTripper func(*http.Request) (*http.Response, error)

func (f roundTripper) RoundTrip(r *http.Request) (*http.Response, error) { return f(r) }

// peerUser is the client certificate, if there is one of our client CA.
func (s *supervisor) peerUser(r *http.Request) *x509.Certificate {
	if r.TLS == nil || len(r.TLS.PeerCertificates) == 0 {
		return nil
	}
	roots := x509.NewCertPool()
	roots.AddCert(s.cas["client-ca"].cert)
	leaf := r.TLS.PeerCertificates[0]
	_, err := leaf.Verify(x509.VerifyOptions{Roots: roots, KeyUsages: []x509.ExtKeyUsage{x509.ExtKeyUsageClientAuth}})
	if err != nil {
		return nil
	}
	return leaf
}

// asker is the key of a request's context for the node whose certificate it showed.
type asker struct{}

// authorized lets in the holders of a token of one of these kinds. Where nodes
// are let in, so are their own certificates and bootstrap tokens.
func (s *supervisor) authorized(next http.HandlerFunc, users ...string) http.HandlerFunc {
	return func(w http.ResponseWriter, r *http.Request) {
		name, secret, basic := r.BasicAuth()
		if basic && s.tokenValid(name, secret, users) {
			next(w, r)
			return
		}
		if slices.Contains(users, "node") {
			if node := nodeOf(s.peerUser(r)); node != "" {
				next(w, r.WithContext(context.WithValue(r.Context(), asker{}, node)))
				return
			}
			joins, err := s.bootstraps(r)
			if err != nil {
				http.Error(w, "apiserver not ready: "+err.Error(), http.StatusServiceUnavailable)
				return
			}
			if joins {
				next(w, r)
				return
			}
		}
		logf("warning", "Rejected %s %s from %s: token is not valid", r.Method, r.URL.Path, r.RemoteAddr)
		http.Error(w, "token is not valid", http.StatusUnauthorized)
	}
}

func (s *supervisor) tokenValid(name, secret string, users []string) bool {
	return slices.Contains(users, name) && (same(secret, s.serversSecret()) || name == "node" && same(secret, s.agentToken))
}

// nodeOf is the name of the node whose kubelet has this certificate.
func nodeOf(cert *x509.Certificate) string {
	if cert == nil || !slices.Contains(cert.Subject.Organization, "system:nodes") {
		return ""
	}
	name, _ := strings.CutPrefix(cert.Subject.CommonName, "system:node:")
	return name
}

// bootstraps asks the API server about a bearer token, as k3s does: whether
// it is a bootstrap token that is there and has not ended.
func (s *supervisor) bootstraps(r *http.Request) (bool, error) {
	bearer, ok := strings.CutPrefix(r.Header.Get("Authorization"), "Bearer ")
	if !ok || !bootstraputil.IsValidBootstrapToken(bearer) {
		return false, nil
	}
	review := &authenticationv1.TokenReview{Spec: authenticationv1.TokenReviewSpec{Token: bearer}}
	found, err := s.kube.AuthenticationV1().TokenReviews().Create(r.Context(), review, metav1.CreateOptions{})
	if err != nil {
		return false, err
	}
	groups := found.Status.User.Groups
	return found.Status.Authenticated && slices.Contains(groups, bootstrapapi.BootstrapDefaultGroup), nil
}

func (s *supervisor) serveCA(name string) http.HandlerFunc {
	return func(w http.ResponseWriter, _ *http.Request) {
		w.Header().Set("Content-Type", "text/plain")
		_, _ = w.Write(s.cas[name].pem)
	}
}

// forNode lets a node have certificates of its own name alone, by its
// password. By a certificate only a node that the cluster knows gets others.
func (s *supervisor) forNode(next http.HandlerFunc) http.HandlerFunc {
	return func(w http.ResponseWriter, r *http.Request) {
		name, password := r.Header.Get(nodeNameHeader), r.Header.Get(nodePasswordHeader)
		if name == "" || password == "" {
			http.Error(w, "node name not set", http.StatusBadRequest)
			return
		}
		if !s.apiReady.Load() {
			http.Error(w, "apiserver not ready", http.StatusServiceUnavailable)
			return
		}
		if err := s.verifyNode(r, name); err != nil {
			status := http.StatusServiceUnavailable
			if apierrors.IsNotFound(err) {
				status = http.StatusUnauthorized
			}
			if errors.Is(err, errOtherNode) {
				status = http.StatusBadRequest
			}
			http.Error(w, "unable to verify node identity: "+err.Error(), status)
			return
		}
		if err := ensureNodePassword(r.Context(), s.kube, name, password); err != nil {
			status := http.StatusServiceUnavailable
			if errors.Is(err, errNodePassword) {
				status = http.StatusForbidden
				logf("error", "Rejected node %s from %s: %v", name, r.RemoteAddr, err)
			}
			http.Error(w, err.Error(), status)
			return
		}
		next(w, r)
	}
}

var errOtherNode = errors.New("header node name does not match auth node name")

// verifyNode has nothing to say of who came with a token.
func (s *supervisor) verifyNode(r *http.Request, name string) error {
	node, ok := r.Context().Value(asker{}).(string)
	if !ok {
		return nil
	}
	if node != name {
		return errOtherNode
	}
	_, err := s.kube.CoreV1().Nodes().Get(r.Context(), node, metav1.GetOptions{})
	return err
}

func (s *supervisor) sign(ca string, subject func(name, ip string) leaf) http.HandlerFunc {
	return func(w http.ResponseWriter, r *http.Request) {
		body, err := io.ReadAll(io.LimitReader(r.Body, 1<<16))
		if err != nil {
			http.Error(w, err.Error(), http.StatusBadRequest)
			return
		}
		public, err := parseCSR(body)
		if err != nil {
			http.Error(w, err.Error(), http.StatusBadRequest)
			return
		}
		cert, err := s.cas[ca].sign(subject(r.Header.Get(nodeNameHeader), r.Header.Get(nodeIPHeader)), public)
		if err != nil {
			http.Error(w, err.Error(), http.StatusInternalServerError)
			return
		}
		_, _ = w.Write(append(cert, s.cas[ca].pem...))
	}
}

// ensureNodePassword remembers a node's password when the node first comes,
// and refuses everybody else who comes under its name.
func ensureNodePassword(ctx context.Context, kube kubernetes.Interface, node, password string) error {
	name, hash := nodePasswordSecret(node), hashCA([]byte(password)) // of 16 random bytes
	secrets := kube.CoreV1().Secrets(metav1.NamespaceSystem)
	existing, err := secrets.Get(ctx, name, metav1.GetOptions{})
	if apierrors.IsNotFound(err) {
		immutable := true
		_, err = secrets.Create(ctx, &corev1.Secret{
			ObjectMeta: metav1.ObjectMeta{Name: name},
			Immutable:  &immutable,
			Data:       map[string][]byte{"hash": []byte(hash)},
		}, metav1.CreateOptions{})
		if apierrors.IsAlreadyExists(err) {
			return ensureNodePassword(ctx, kube, node, password)
		}
		return err
	}
	if err != nil {
		return err
	}
	if !same(string(existing.Data["hash"]), hash) {
		return errNodePassword
	}
	return nil
}

func nodePasswordSecret(node string) string { return node + ".node-password.k3s" }

// nodePassword is this host's, made once.
func nodePassword() (string, error) {
	if content, err := os.ReadFile(nodePasswordFile); err == nil {
		return strings.TrimSpace(string(content)), nil
	}
	password := randomHex(16)
	_, err := writeFile(nodePasswordFile, []byte(password+"\n"), 0o600)
	return password, err
}
