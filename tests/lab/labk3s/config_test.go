package main

import (
	"os"
	"path/filepath"
	"reflect"
	"slices"
	"strings"
	"testing"
)

// load merges a config.yaml, drop-ins (name, content, ...), an environment and
// flags. Every case gives node-name and node-ip, so that none depends on the
// machine.
func load(t *testing.T, command, main string, drops []string, environ, args []string) (*config, error) {
	t.Helper()
	dir := t.TempDir()
	path := filepath.Join(dir, "config.yaml")
	write := func(path, content string) {
		if err := os.MkdirAll(filepath.Dir(path), 0o755); err != nil {
			t.Fatal(err)
		}
		if err := os.WriteFile(path, []byte(content), 0o600); err != nil {
			t.Fatal(err)
		}
	}
	write(path, main)
	for i := 0; i < len(drops); i += 2 {
		write(filepath.Join(path+".d", drops[i]), drops[i+1])
	}
	args = append([]string{"--config", path, "--node-name", "n", "--node-ip", "192.0.2.1"}, args...)
	return loadConfig(command, args, environ)
}

func TestConfigMerge(t *testing.T) {
	main := `
token: from-file
tls-san: [a, b]
node-label: [x=1]
write-kubeconfig-mode: 0644
cluster-init: true
`
	drops := []string{
		"20-b.yaml", "tls-san: d,e\n",
		"10-a.yaml", "node-label+: [y=2]\ntls-san: [c]\n",
		"30-ignored.txt", "no: yaml",
	}
	environ := []string{"K3S_TOKEN=from-env", "K3S_KUBECONFIG_OUTPUT=/from/env", "HOME=/"}
	c, err := load(t, "server", main, drops, environ, []string{"--node-label=z=3", "--kubelet-arg", "max-pods=50"})
	if err != nil {
		t.Fatal(err)
	}
	for _, check := range []struct {
		what      string
		got, want any
	}{
		{"a file wins over the environment", c.token, "from-file"},
		{"the environment wins over the default", c.kubeconfig, "/from/env"},
		{"the last drop-in wins, and is split at commas", c.tlsSANs, []string{"d", "e"}},
		{"a flag replaces a list", c.nodeLabels, []string{"z=3"}},
		{"an unquoted mode", c.kubeconfigMode, os.FileMode(0o644)},
		{"a boolean", c.clusterInit, true},
		{"a separate value", c.kubeletArgs, []string{"max-pods=50"}},
		{"DNS follows from the service network", c.clusterDNS, "10.43.0.10"},
	} {
		if !reflect.DeepEqual(check.got, check.want) {
			t.Errorf("%s: got %v, want %v", check.what, check.got, check.want)
		}
	}
	c, err = load(t, "server", main, drops, nil, nil)
	if err != nil {
		t.Fatal(err)
	}
	if want := []string{"x=1", "y=2"}; !slices.Equal(c.nodeLabels, want) {
		t.Errorf("key+ adds to a list: got %v, want %v", c.nodeLabels, want)
	}
}

func TestConfigRefusals(t *testing.T) {
	for _, test := range []struct {
		command, file string
		environ, args []string
		want          string
	}{
		{"server", "frobnicate: 1", nil, nil, `key "frobnicate" is not an option that labk3s has`},
		{"agent", "cluster-init: true", nil, nil, "key \"cluster-init\" is not an option of `k3s agent`"},
		{"server", "", nil, []string{"--docker"}, "flag --docker is not an option that labk3s has"},
		{"server", "flannel-backend: vxlan", nil, nil, `labk3s lacks the value "vxlan" (it has host-gw)`},
		{"server", "disable: [nothing]", nil, nil, `labk3s lacks the value "nothing"`},
		{"server", "cluster-cidr: 10.1.0.0/16,fd00::/48", nil, nil, "dual stack"},
		{"server", "cluster-init: perhaps", nil, nil, "neither true nor false"},
		{"server", "token: [a]", nil, nil, "a plain value is wanted"},
		{"server", "token: a\ntoken: b", nil, nil, "token"},
		{"server", "[a, b]", nil, nil, "not a mapping"},
		{"server", "", []string{"K3S_FROB=x"}, nil, "K3S_FROB"},
		{"server", "", nil, []string{"leftover"}, `takes no argument "leftover"`},
		{"server", "write-kubeconfig-mode: rw", nil, nil, "not a file mode"},
		{"server", "token-file: /nonexistent", nil, nil, "token-file"},
		{"server", "cluster-reset-restore-path: /x", nil, nil, "--cluster-reset required"},
		{"server", "server: https://a:6443", nil, nil, "--token is required"},
		{"agent", "token: a", nil, nil, "--server is required"},
		{"agent", "server: https://a:6443", nil, nil, "--token is required"},
		{"agent", "token: a", []string{"K3S_URL=http://a:6443"}, nil, "not an https:// URL"},
	} {
		_, err := load(t, test.command, test.file, nil, test.environ, test.args)
		if err == nil || !strings.Contains(err.Error(), test.want) {
			t.Errorf("%s %q %v %v: got %v, want %q", test.command, test.file, test.environ, test.args, err, test.want)
		}
	}
}

func TestMergeArgs(t *testing.T) {
	got, err := mergeArgs(map[string]string{"v": "1", "gates": "A=true", "keep": "me"},
		[]string{"v=5", "gates+=B=true", "--new", "multi=1", "multi=2"})
	if err != nil {
		t.Fatal(err)
	}
	want := []string{"--gates=A=true,B=true", "--keep=me", "--multi=1", "--multi=2", "--new=true", "--v=5"}
	if !slices.Equal(got, want) {
		t.Errorf("got %v, want %v", got, want)
	}
	if _, err := mergeArgs(nil, []string{"config=/x"}); err == nil {
		t.Error("a component's own configuration file was accepted")
	}
}
