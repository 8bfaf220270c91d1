package main

import (
	"context"
	"fmt"
	"net"
	"net/http"
	"net/url"
	"os"
	"os/exec"
	"os/signal"
	"strconv"
	"strings"
	"syscall"
	"time"

	metav1 "k8s.io/apimachinery/pkg/apis/meta/v1"
	"k8s.io/client-go/kubernetes"
	"sigs.k8s.io/yaml"
)

func agentCommand(args []string) error {
	c, err := loadConfig(false, configFile, args)
	if err != nil {
		return err
	}
	t, err := parseToken(c.token, "node")
	if err != nil {
		return err
	}
	ctx, stop := signal.NotifyContext(context.Background(), syscall.SIGTERM, syscall.SIGINT)
	defer stop()
	logf("info", "Starting k3s agent %s", version)

	procs := newProcesses()
	run, cancel := context.WithCancel(ctx)
	failed := make(chan error, 1)
	go func() {
		if err := runAgent(run, c, procs, t, func() { notify("READY=1") }); err != nil && run.Err() == nil {
			failed <- err
		}
	}()
	var result error
	select {
	case <-ctx.Done():
		logf("info", "Stopping: asked to")
		notify("STOPPING=1")
	case result = <-failed:
	case result = <-procs.died:
	}
	procs.stop("kubelet", "kube-proxy")
	cancel()
	procs.stop()
	return result
}

// runAgent makes this host a node and returns when the node has registered;
// what it started goes on until ctx ends. A server runs one as well, towards
// itself, and passes no registered.
func runAgent(ctx context.Context, c *config, procs *processes, t token, registered func()) error {
	password, err := nodePassword()
	if err != nil {
		return err
	}
	prepareHost()

	// On a server there is work to do while the control plane starts. An
	// agent, like k3s's, runs nothing before its server has spoken to it.
	images := c.dataDir.agent("images")
	var runtime chan error
	startRuntime := func() {
		runtime = make(chan error, 1)
		go func() { runtime <- startContainerd(ctx, c, procs, images) }()
	}
	supervisorURL, apiURL := "https://127.0.0.1:"+apiPort, apiserverURL
	var lb *loadBalancer
	if c.server {
		startRuntime()
	} else {
		u, err := url.Parse(c.ServerURL)
		if err != nil || u.Hostname() == "" {
			return fmt.Errorf("server: %q is not a URL", c.ServerURL)
		}
		port := u.Port()
		if port == "" {
			port = "443"
		}
		lb = &loadBalancer{net.JoinHostPort(u.Hostname(), port)}
		if err := lb.serve(ctx, balancer); err != nil {
			return err
		}
		supervisorURL = "https://" + balancer
		apiURL = supervisorURL
	}
	if err := join(ctx, c, supervisorURL, t, password, lb); err != nil {
		return err
	}
	if runtime == nil {
		startRuntime()
	}
	if err := <-runtime; err != nil {
		return err
	}

	agent := c.dataDir.agent
	for name, base := range map[string]string{
		"kubelet": "client-kubelet", "kubeproxy": "client-kube-proxy", "k3scontroller": "client-k3s-controller",
	} {
		if err := writeKubeconfig(agent(name+".kubeconfig"), apiURL, agent("server-ca.crt"), agent(base), false, 0o600); err != nil {
			return err
		}
	}
	kube, err := kubernetes.NewForConfig(restConfig(apiURL, agent("server-ca.crt"), agent("client-k3s-controller")))
	if err != nil {
		return err
	}
	if err := startKubelet(ctx, c, procs); err != nil {
		return err
	}
	if err := startKubeProxy(ctx, c, procs); err != nil {
		return err
	}
	if err := waitRegistered(ctx, c, kube); err != nil {
		return err
	}
	logf("info", "Node %s is registered", c.NodeName)
	if registered != nil {
		registered()
		logf("info", "k3s agent is up and running")
	}
	go runRoutes(ctx, c, kube)
	go runNetworkPolicies(ctx, c, kube)
	go runVolumes(ctx, c, kube)
	return nil
}

// join retries until the server has accepted this node: a server that is away
// comes back, and a wrong token or password can be put right on either side.
func join(ctx context.Context, c *config, supervisor string, t token, password string, lb *loadBalancer) error {
	said, saidAt := "", time.Time{}
	return poll(ctx, 200*time.Millisecond, 0, func() (bool, error) {
		err := tryJoin(ctx, c, supervisor, t, password, lb)
		if err == nil {
			return true, nil
		}
		// The same trouble is worth a line every few seconds, not five a second.
		if text := err.Error(); (text != said || time.Since(saidAt) > 5*time.Second) && ctx.Err() == nil {
			said, saidAt = text, time.Now()
			if refused(err) {
				logf("error", "%s", text)
			} else {
				logf("info", "Waiting to retrieve agent configuration; server is not ready: %s", text)
			}
		}
		if refused(err) {
			// Somebody has to change something first, and each refusal is a
			// line in the server's log, too.
			select {
			case <-ctx.Done():
			case <-time.After(2 * time.Second):
			}
		}
		return false, err
	})
}

func tryJoin(ctx context.Context, c *config, supervisor string, t token, password string, lb *loadBalancer) error {
	j, err := newJoiner(ctx, supervisor, t, lb)
	if err != nil {
		return err
	}
	agent := c.dataDir.agent
	j.identify(agent("client-kubelet"))
	for _, signed := range []string{"serving-kubelet", "client-kubelet", "client-kube-proxy", "client-k3s-controller"} {
		if err := j.sign(ctx, "/v1-k3s/"+signed+".crt", agent(signed), c.NodeName, password, c.NodeIP); err != nil {
			return err
		}
	}
	clientCA, err := j.get(ctx, "/v1-k3s/client-ca.crt")
	if err != nil {
		return err
	}
	for path, content := range map[string][]byte{agent("server-ca.crt"): j.ca, agent("client-ca.crt"): clientCA} {
		if _, err := writeFile(path, content, 0o644); err != nil {
			return err
		}
	}
	return nil
}

// prepareHost sets what pods and Services need of the kernel. On a host that
// does not allow it, it is often already so; if not, the log says what is amiss.
func prepareHost() {
	for _, module := range []string{"br_netfilter", "overlay"} {
		_ = exec.Command("modprobe", module).Run() // may well be built in
	}
	for name, least := range map[string]int{
		"net/ipv4/ip_forward": 1, "net/ipv4/conf/all/forwarding": 1, "net/bridge/bridge-nf-call-iptables": 1,
		// All lab hosts of a machine draw on one supply of these.
		"fs/inotify/max_user_instances": 1024, "fs/inotify/max_user_watches": 524288,
	} {
		path := "/proc/sys/" + name
		if content, err := os.ReadFile(path); err == nil {
			if value, err := strconv.Atoi(strings.TrimSpace(string(content))); err == nil && value >= least {
				continue
			}
		}
		if err := os.WriteFile(path, []byte(strconv.Itoa(least)), 0o644); err != nil {
			logf("warning", "setting %s: %v", strings.ReplaceAll(name, "/", "."), err)
		}
	}
	// Volumes that a pod mounts must be visible on the host, whatever the
	// mount propagation that a container engine left us with.
	if err := syscall.Mount("", "/", "", syscall.MS_SHARED|syscall.MS_REC, ""); err != nil {
		logf("warning", "making / a shared mount: %v", err)
	}
}

// kubeletConfig is for hosts that are containers themselves (and does no harm
// on others): no right to lower oom_score_adj, no view of the file system's
// device, no say about swap and huge pages.
func kubeletConfig(c *config) map[string]any {
	agent := c.dataDir.agent
	return map[string]any{
		"kind": "KubeletConfiguration", "apiVersion": "kubelet.config.k8s.io/v1beta1",
		"authentication": map[string]any{
			"anonymous": map[string]any{"enabled": false},
			"webhook":   map[string]any{"enabled": true},
			"x509":      map[string]any{"clientCAFile": agent("client-ca.crt")},
		},
		"authorization":                 map[string]any{"mode": "Webhook"},
		"address":                       "0.0.0.0",
		"cgroupDriver":                  "cgroupfs",
		"clusterDNS":                    []string{clusterDNS},
		"clusterDomain":                 clusterDomain,
		"containerRuntimeEndpoint":      "unix://" + containerdSocket,
		"evictionHard":                  map[string]string{},
		"failCgroupV1":                  false,
		"failSwapOn":                    false,
		"featureGates":                  map[string]bool{"KubeletInUserNamespace": true},
		"healthzBindAddress":            "127.0.0.1",
		"imageGCHighThresholdPercent":   100,
		"localStorageCapacityIsolation": false,
		"protectKernelDefaults":         c.ProtectKernel,
		"serializeImagePulls":           false,
		"staticPodPath":                 agent("pod-manifests"),
		"tlsCertFile":                   agent("serving-kubelet.crt"),
		"tlsPrivateKeyFile":             agent("serving-kubelet.key"),
		"volumePluginDir":               agent("libexec", "kubernetes", "kubelet-plugins", "volume", "exec"),
		// A container that stops at once should be seen at once.
		"syncFrequency": "30s",
	}
}

func startKubelet(ctx context.Context, c *config, procs *processes) error {
	content, err := yaml.Marshal(kubeletConfig(c))
	if err != nil {
		return err
	}
	path := c.dataDir.agent("etc", "kubelet.yaml")
	if _, err := writeFile(path, content, 0o600); err != nil {
		return err
	}
	if err := os.MkdirAll(c.dataDir.agent("pod-manifests"), 0o700); err != nil {
		return err
	}
	if err := waitFree(ctx, 10248, 10250); err != nil {
		return err
	}
	return procs.component("kubelet", arguments(map[string]string{
		"config":            path,
		"hostname-override": c.NodeName,
		"kubeconfig":        c.dataDir.agent("kubelet.kubeconfig"),
		"node-ip":           c.NodeIP,
		"root-dir":          kubeletDir,
	}, c.KubeletArgs...))
}

func startKubeProxy(ctx context.Context, c *config, procs *processes) error {
	if err := waitFree(ctx, 10249, 10256); err != nil {
		return err
	}
	return procs.component("kube-proxy", arguments(map[string]string{
		"cluster-cidr":      clusterCIDR,
		"hostname-override": c.NodeName,
		"kubeconfig":        c.dataDir.agent("kubeproxy.kubeconfig"),
		"proxy-mode":        "iptables",
		// Read-only sysctls in a container; 0 leaves them alone.
		"conntrack-max-per-core":            "0",
		"conntrack-tcp-timeout-established": "0s",
		"conntrack-tcp-timeout-close-wait":  "0s",
		"healthz-bind-address":              "127.0.0.1:10256",
		"metrics-bind-address":              "127.0.0.1:10249",
	}))
}

// waitRegistered waits for this run's kubelet and for the node object, which
// on a restart is there already.
func waitRegistered(ctx context.Context, c *config, kube kubernetes.Interface) error {
	return poll(ctx, 200*time.Millisecond, 0, func() (bool, error) {
		response, err := http.Get("http://127.0.0.1:10248/healthz")
		if err != nil {
			return false, err
		}
		response.Body.Close()
		if response.StatusCode != http.StatusOK {
			return false, fmt.Errorf("kubelet: %s", response.Status)
		}
		_, err = kube.CoreV1().Nodes().Get(ctx, c.NodeName, metav1.GetOptions{})
		return err == nil, err
	})
}
