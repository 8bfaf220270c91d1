package main

import (
	"context"
	"errors"
	"fmt"
	"io/fs"
	"net/url"
	"os"
	"os/exec"
	"path/filepath"
	"slices"
	"sort"
	"strings"
	"time"

	"google.golang.org/grpc"
	"google.golang.org/grpc/credentials/insecure"
	cri "k8s.io/cri-api/pkg/apis/runtime/v1"
	"sigs.k8s.io/yaml"
)

// startContainerd runs the host's containerd with a configuration of ours and
// brings in the images that lie ready. Containers belong to their shims, which
// outlive containerd and us: a restart of the service restarts no pod.
func startContainerd(ctx context.Context, c *config, procs *processes, images *imageImporter) error {
	program, err := exec.LookPath("containerd")
	if err != nil {
		return err
	}
	registries, err := loadRegistries(c.registries)
	if err != nil {
		return err
	}
	hostsDir := c.dataDir.agent("etc", "containerd", "certs.d")
	if err := registries.writeHosts(hostsDir); err != nil {
		return err
	}
	content := containerdConfig(c, hostsDir, registries)
	path := c.dataDir.agent("etc", "containerd", "config.toml")
	if _, err := writeFile(path, []byte(content), 0o600); err != nil {
		return err
	}
	logFile := c.dataDir.agent("containerd", "containerd.log")
	for _, dir := range []string{filepath.Dir(logFile), images.dir, c.dataDir.agent("etc", "cni", "net.d"), containerdState} {
		if err := os.MkdirAll(dir, 0o755); err != nil {
			return err
		}
	}
	if err := procs.program(logFile, program, "--config", path); err != nil {
		return err
	}
	if err := waitContainerd(ctx); err != nil {
		return fmt.Errorf("containerd is not ready (its log is %s): %w", logFile, err)
	}
	images.start(ctx)
	return nil
}

func containerdConfig(c *config, hostsDir string, r *registries) string {
	var b strings.Builder
	fmt.Fprintf(&b, `version = 2
root = %q
state = %q
disabled_plugins = ["io.containerd.snapshotter.v1.aufs", "io.containerd.snapshotter.v1.btrfs", "io.containerd.snapshotter.v1.devmapper", "io.containerd.snapshotter.v1.zfs"]

[grpc]
  address = %q

[plugins."io.containerd.grpc.v1.cri"]
  sandbox_image = %q
  enable_selinux = false
  restrict_oom_score_adj = true
  disable_hugetlb_controller = true
  tolerate_missing_hugetlb_controller = true

[plugins."io.containerd.grpc.v1.cri".containerd]
  snapshotter = %q
  disable_snapshot_annotations = true

[plugins."io.containerd.grpc.v1.cri".containerd.runtimes.runc]
  runtime_type = "io.containerd.runc.v2"

[plugins."io.containerd.grpc.v1.cri".containerd.runtimes.runc.options]
  SystemdCgroup = false

[plugins."io.containerd.grpc.v1.cri".cni]
  bin_dir = %q
  conf_dir = %q

[plugins."io.containerd.grpc.v1.cri".registry]
  config_path = %q
`, c.dataDir.agent("containerd"), containerdState, containerdSocket, c.pauseImage, c.snapshotter,
		cniBinDir, c.dataDir.agent("etc", "cni", "net.d"), hostsDir)
	for _, host := range sortedKeys(r.Configs) {
		if auth := r.Configs[host].Auth; auth != nil {
			fmt.Fprintf(&b, "\n[plugins.\"io.containerd.grpc.v1.cri\".registry.configs.%q.auth]\n", host)
			for _, field := range []struct{ name, value string }{
				{"username", auth.Username}, {"password", auth.Password}, {"auth", auth.Auth}, {"identitytoken", auth.IdentityToken},
			} {
				if field.value != "" {
					fmt.Fprintf(&b, "  %s = %q\n", field.name, field.value)
				}
			}
		}
	}
	return b.String()
}

func sortedKeys[V any](m map[string]V) []string {
	keys := make([]string, 0, len(m))
	for key := range m {
		keys = append(keys, key)
	}
	sort.Strings(keys)
	return keys
}

// registries is k3s's registries.yaml.
type registries struct {
	Mirrors map[string]registryMirror `json:"mirrors"`
	Configs map[string]registryConfig `json:"configs"`
}

type registryMirror struct {
	Endpoints []string          `json:"endpoint"`
	Rewrites  map[string]string `json:"rewrite"`
}

type registryConfig struct {
	Auth *registryAuth `json:"auth"`
	TLS  *registryTLS  `json:"tls"`
}

type registryAuth struct {
	Username      string `json:"username"`
	Password      string `json:"password"`
	Auth          string `json:"auth"`
	IdentityToken string `json:"identity_token"`
}

type registryTLS struct {
	CAFile   string `json:"ca_file"`
	CertFile string `json:"cert_file"`
	KeyFile  string `json:"key_file"`
	Insecure bool   `json:"insecure_skip_verify"`
}

func loadRegistries(path string) (*registries, error) {
	r := &registries{}
	content, err := os.ReadFile(path)
	if errors.Is(err, fs.ErrNotExist) {
		return r, nil
	}
	if err != nil {
		return nil, err
	}
	if err := yaml.UnmarshalStrict(content, r); err != nil {
		return nil, fmt.Errorf("%s: %w", path, err)
	}
	for name, mirror := range r.Mirrors {
		if len(mirror.Rewrites) > 0 {
			return nil, fmt.Errorf("%s: labk3s lacks rewrite (of mirror %q): it needs k3s's own containerd", path, name)
		}
	}
	return r, nil
}

// writeHosts turns them into containerd's own form, one directory per registry.
func (r *registries) writeHosts(dir string) error {
	if err := os.RemoveAll(dir); err != nil {
		return err
	}
	names := sortedKeys(r.Mirrors)
	for _, host := range sortedKeys(r.Configs) {
		if !slices.Contains(names, host) && r.Configs[host].TLS != nil {
			names = append(names, host)
		}
	}
	for _, name := range names {
		sub := name
		if name == "*" {
			sub = "_default"
		}
		content, err := r.hosts(name)
		if err != nil {
			return err
		}
		if _, err := writeFile(filepath.Join(dir, sub, "hosts.toml"), []byte(content), 0o600); err != nil {
			return err
		}
	}
	return nil
}

func (r *registries) hosts(name string) (string, error) {
	var b strings.Builder
	upstream := "https://" + name
	switch name {
	case "docker.io":
		upstream = "https://registry-1.docker.io"
	case "*":
		upstream = ""
	}
	if upstream != "" {
		fmt.Fprintf(&b, "server = %q\n", upstream)
	}
	endpoints := r.Mirrors[name].Endpoints
	if len(endpoints) == 0 {
		endpoints = []string{upstream}
	}
	for _, endpoint := range endpoints {
		if !strings.Contains(endpoint, "://") {
			endpoint = "https://" + endpoint
		}
		u, err := url.Parse(endpoint)
		if err != nil || u.Host == "" {
			return "", fmt.Errorf("registries.yaml: mirror %q: %q is not a URL", name, endpoint)
		}
		fmt.Fprintf(&b, "\n[host.%q]\n  capabilities = [\"pull\", \"resolve\"]\n", strings.TrimRight(endpoint, "/"))
		if u.Path != "" && u.Path != "/" {
			// An endpoint with a path of its own has the API's in it already.
			fmt.Fprintf(&b, "  override_path = true\n")
		}
		if tls := r.Configs[u.Host].TLS; tls != nil {
			if tls.CAFile != "" {
				fmt.Fprintf(&b, "  ca = [%q]\n", tls.CAFile)
			}
			if tls.CertFile != "" {
				fmt.Fprintf(&b, "  client = [[%q, %q]]\n", tls.CertFile, tls.KeyFile)
			}
			if tls.Insecure {
				fmt.Fprintf(&b, "  skip_verify = true\n")
			}
		}
	}
	return b.String(), nil
}

func dialCRI() (*grpc.ClientConn, error) {
	return grpc.NewClient("unix://"+containerdSocket, grpc.WithTransportCredentials(insecure.NewCredentials()),
		grpc.WithDefaultCallOptions(grpc.MaxCallRecvMsgSize(16<<20)))
}

// waitContainerd waits for the runtime service, not just for the socket.
func waitContainerd(ctx context.Context) error {
	return poll(ctx, 100*time.Millisecond, time.Minute, func() (bool, error) {
		conn, err := dialCRI()
		if err != nil {
			return false, err
		}
		defer conn.Close()
		call, cancel := context.WithTimeout(ctx, time.Second)
		defer cancel()
		_, err = cri.NewRuntimeServiceClient(conn).Version(call, &cri.VersionRequest{})
		return err == nil, err
	})
}
