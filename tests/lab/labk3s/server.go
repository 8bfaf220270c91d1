package main

import (
	"context"
	"errors"
	"fmt"
	"os"
	"os/signal"
	"syscall"

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
	secret, err := prepareServer(c)
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
		server, err := startEtcd(run, c)
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

var errOtherToken = errors.New("bootstrap data already found and encrypted with different token")

// prepareServer settles the token.
func prepareServer(c *config) (string, error) {
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
	if ca, err := os.ReadFile(c.dataDir.tls("server-ca.crt")); err == nil {
		if err := given.verifyCA(ca); err != nil {
			return "", err
		}
	} else if given.caHash != "" {
		return "", errors.New("the token names a cluster's CA, but this server would start a new cluster: give the secret alone")
	}
	return secret, nil
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
	go runNodeController(ctx, c, s.kube)
	go runProvisioner(ctx, c, s.kube)
	return nil
}
