package main

import (
	"context"
	"errors"
	"fmt"
	"os"
	"os/signal"
	"strings"
	"syscall"
	"time"

	"go.etcd.io/etcd/server/v3/embed"
	"k8s.io/client-go/kubernetes"
)

func serverCommand(args []string) error {
	c, err := loadConfig(true, configFile, args)
	if err != nil {
		return err
	}
	ctx, stop := signal.NotifyContext(context.Background(), syscall.SIGTERM, syscall.SIGINT)
	defer stop()
	// The directory holds every key of the cluster.
	if err := os.MkdirAll(c.dataDir.server(), 0o700); err != nil {
		return err
	}
	logf("info", "Starting k3s %s", version)
	if c.clusterReset {
		return clusterReset(c)
	}
	err = runServer(ctx, c)
	if errors.Is(err, context.Canceled) && ctx.Err() != nil {
		return nil // asked to stop while starting
	}
	return err
}

func runServer(ctx context.Context, c *config) error {
	secret, err := prepareServer(ctx, c)
	if err != nil {
		return fmt.Errorf("starting kubernetes: preparing server: %w", err)
	}
	cas, err := ensureCAs(c.dataDir)
	if err != nil {
		return err
	}
	if err := serverLeaves(c, cas); err != nil {
		return err
	}
	if err := ensureEncryption(c); err != nil {
		return err
	}
	agentSecret, err := writeTokens(c, cas, secret)
	if err != nil {
		return err
	}

	procs := newProcesses()
	run, cancel := context.WithCancel(ctx)
	failed := make(chan error, 8)
	guard := func(name string, f func() error) {
		go func() {
			if err := f(); err != nil && run.Err() == nil {
				failed <- fmt.Errorf("%s: %w", name, err)
			}
		}()
	}
	s := &supervisor{config: c, cas: cas, serverToken: secret, agentToken: agentSecret}
	s.kube, err = kubernetes.NewForConfig(restConfig(apiserverURL, c.dataDir.tls("server-ca.crt"), c.dataDir.tls("client-supervisor")))
	if err != nil {
		cancel()
		return err
	}
	etcd := make(chan *embed.Etcd, 1)
	guard("agent", func() error {
		own := token{caHash: hashCA(cas["server-ca"].pem), user: "server", secret: secret}
		return runAgent(run, c, procs, own, nil)
	})
	guard("server", func() error {
		server, err := startDatastore(run, c, s)
		if server != nil {
			etcd <- server
		}
		if err != nil {
			return err
		}
		return startAPI(run, c, procs, s)
	})

	var result error
	select {
	case <-ctx.Done():
		logf("info", "Stopping: asked to")
		notify("STOPPING=1")
	case result = <-failed:
	case result = <-procs.died:
	}
	// The clients of a part go before it.
	procs.stop("kubelet", "kube-proxy", "kube-scheduler", "kube-controller-manager")
	cancel()
	procs.stop("kube-apiserver")
	select {
	case server := <-etcd:
		server.Close()
	default:
	}
	procs.stop()
	return result
}

// prepareServer settles the token and, for a server that joins, fetches what
// all servers share.
var errOtherToken = errors.New("bootstrap data already found and encrypted with different token")

func prepareServer(ctx context.Context, c *config) (string, error) {
	stored := ""
	if content, err := os.ReadFile(c.dataDir.server("token")); err == nil {
		t, err := parseToken(string(content), "server")
		if err != nil {
			return "", fmt.Errorf("%s: %w", c.dataDir.server("token"), err)
		}
		stored = t.secret
	}
	secret := stored
	var given token
	if c.token != "" {
		var err error
		if given, err = parseToken(c.token, "server"); err != nil {
			return "", err
		}
		secret = given.secret
		if stored != "" && c.etcdInitialised() && !same(stored, secret) {
			return "", errOtherToken
		}
	}
	if secret == "" {
		secret = randomHex(16)
	}
	if c.ServerURL == "" || c.etcdInitialised() {
		if ca, err := os.ReadFile(c.dataDir.tls("server-ca.crt")); err == nil {
			if err := given.verifyCA(ca); err != nil {
				return "", err
			}
		} else if given.caHash != "" {
			return "", errors.New("the token names a cluster's CA, but this server would start a new cluster: give the secret alone, or --server")
		}
		return secret, nil
	}
	return secret, poll(ctx, time.Second, 0, func() (bool, error) {
		err := fetchBootstrap(ctx, c, given)
		if err == nil || refused(err) || errors.Is(err, errOtherEncryption) {
			return true, err
		}
		logf("warning", "Waiting for the server to join: %v", err)
		return false, err
	})
}

func fetchBootstrap(ctx context.Context, c *config, t token) error {
	j, err := newJoiner(ctx, c.ServerURL, t, nil)
	if err != nil {
		return err
	}
	shared := map[string]string{}
	if err := j.getJSON(ctx, "/v1-k3s/server-bootstrap", &shared); err != nil {
		return err
	}
	if err := takeEncryption(c, shared[encryptionShared]); err != nil {
		return err
	}
	for _, name := range sharedFiles() {
		mode := os.FileMode(0o600)
		if strings.HasSuffix(name, ".crt") {
			mode = 0o644
		}
		if _, err := writeFile(c.dataDir.tls(name), []byte(shared[name]), mode); err != nil {
			return err
		}
	}
	logf("info", "Took over the cluster's certificate authorities from %s", c.ServerURL)
	return nil
}

// sharedFiles are what all servers of a cluster have, below server/tls: one
// that joins gets them from the one that it joins.
func sharedFiles() []string {
	files := []string{"service.key"}
	for _, ca := range caNames {
		files = append(files, ca+".crt", ca+".key")
	}
	return files
}

// writeTokens writes the token files as k3s does and returns the secret that
// agents join with: their own, or that of the servers where there is none.
func writeTokens(c *config, cas map[string]*authority, secret string) (string, error) {
	hash := hashCA(cas["server-ca"].pem)
	server := token{hash, "server", secret}
	agent := server
	if c.agentToken != "" {
		given, err := parseToken(c.agentToken, "node")
		if err != nil {
			return "", fmt.Errorf("agent-token: %w", err)
		}
		agent = token{hash, "node", given.secret}
	}
	for name, t := range map[string]token{"token": server, "agent-token": agent} {
		if _, err := writeFile(c.dataDir.server(name), []byte(t.String()+"\n"), 0o600); err != nil {
			return "", err
		}
	}
	return agent.secret, nil
}

// startDatastore starts or joins etcd.
func startDatastore(ctx context.Context, c *config, s *supervisor) (*embed.Etcd, error) {
	initial, joining := "", c.ServerURL != "" && !c.etcdInitialised()
	if joining {
		t, err := parseToken(c.token, "server")
		if err != nil {
			return nil, err
		}
		err = poll(ctx, time.Second, 0, func() (bool, error) {
			j, err := newJoiner(ctx, c.ServerURL, t, nil)
			var endpoints []string
			if err == nil {
				err = j.getJSON(ctx, "/v1-k3s/etcd-endpoints", &endpoints)
			}
			if err == nil {
				initial, err = addMember(ctx, c, endpoints)
			}
			if err != nil {
				// Another server may be joining: etcd takes one at a time.
				logf("warning", "Waiting to join etcd: %v", err)
				return false, err
			}
			return true, nil
		})
		if err != nil {
			return nil, err
		}
	}
	server, err := startEtcd(ctx, c, initial, joining)
	if err != nil {
		return nil, err
	}
	if err := promote(ctx, c, server, peersOf(server)); err != nil {
		return server, fmt.Errorf("promoting this etcd member: %w", err)
	}
	s.etcd, err = c.etcdClient(etcdLocal)
	return server, err
}

func peersOf(server *embed.Etcd) []string {
	var endpoints []string
	for _, member := range server.Server.Cluster().Members() {
		if member.ID != server.Server.MemberID() && !member.IsLearner {
			endpoints = append(endpoints, member.ClientURLs...)
		}
	}
	return endpoints
}

// startAPI brings up the control plane and all that works through it.
func startAPI(ctx context.Context, c *config, procs *processes, s *supervisor) error {
	if err := s.serve(ctx); err != nil {
		return err
	}
	admin := c.dataDir.tls("client-admin")
	if err := writeKubeconfig(kubeconfigFile, "https://127.0.0.1:"+apiPort, c.dataDir.tls("server-ca.crt"), admin, true, 0o600); err != nil {
		return err
	}
	logf("info", "Wrote kubeconfig %s", kubeconfigFile)
	err := startControlPlane(ctx, c, procs, s.kube, func() {
		s.apiReady.Store(true)
		logf("info", "Kube API server is now running")
		logf("info", "k3s is up and running")
		notify("READY=1")
	})
	if err != nil {
		return err
	}
	go applyPackaged(ctx, c)
	go runNodeController(ctx, c, s.kube, s.etcd)
	go runProvisioner(ctx, c, s.kube)
	return nil
}
