package main

import (
	"os"
	"path/filepath"
	"slices"
	"strings"
	"testing"
)

// load reads a config.yaml that has what every host's has, and this.
func load(t *testing.T, server bool, text string, args ...string) (*config, error) {
	t.Helper()
	path := filepath.Join(t.TempDir(), "config.yaml")
	if err := os.WriteFile(path, []byte("node-name: n\nnode-ip: 192.0.2.1\n"+text), 0o600); err != nil {
		t.Fatal(err)
	}
	return loadConfig(server, path, args)
}

func TestConfig(t *testing.T) {
	c, err := load(t, true, "tls-san: [a]\ndisable: [traefik]\ncluster-init: true\n"+
		"secrets-encryption: true\nprotect-kernel-defaults: true\nkube-apiserver-arg: [audit-log-maxage=30]\nkube-controller-manager-arg: [terminated-pod-gc-threshold=100]\n",
		"--cluster-reset", "--cluster-reset-restore-path=/x")
	if err != nil {
		t.Fatal(err)
	}
	if !slices.Equal(c.TLSSANs, []string{"a"}) || !c.ClusterInit || c.resetRestore != "/x" {
		t.Errorf("got %+v", c)
	}
	if !c.SecretsEncryption || kubeletConfig(c)["protectKernelDefaults"] != true {
		t.Errorf("got %+v", c)
	}
	if !slices.Contains(arguments(apiserverArgs(c), c.APIServerArgs...), "--audit-log-maxage=30") ||
		!slices.Contains(arguments(controllerArgs(c), c.ControllerArgs...), "--terminated-pod-gc-threshold=100") {
		t.Errorf("got %+v", c)
	}
}

func TestConfigRefusals(t *testing.T) {
	for _, test := range []struct {
		server     bool
		file, flag string
		want       string
	}{
		{true, "frobnicate: 1", "", `unknown field "frobnicate"`},
		{true, "", "--docker", "not defined: -docker"},
		{true, "disable: [nothing]", "", `labk3s lacks the value "nothing"`},
		{true, "write-kubeconfig-mode: rw", "", `labk3s lacks the value "rw"`},
		{true, "token-file: /nonexistent", "", "token-file"},
		{true, "token-file: /dev/null", "", "is empty"},
		{true, "", "--cluster-reset", "lacks --cluster-reset without"},
		{true, "server: https://a:6443", "", "lacks a server that joins"},
		{false, "server: https://a:6443", "", "--token is required"},
		{true, "", "leftover", `takes no argument "leftover"`},
		{false, "", "--cluster-reset", "not defined: -cluster-reset"},
		{false, "token-file: /etc/hostname", "", "--server is required"},
		{false, "server: https://a\nsecrets-encryption: true", "", "are for servers"},
		{false, "server: https://a\nkube-apiserver-arg: [v=1]", "", "are for servers"},
		{false, "token-file: /etc/hostname\nserver: http://a:6443", "", "not an https:// URL"},
	} {
		var args []string
		if test.flag != "" {
			args = append(args, test.flag)
		}
		if _, err := load(t, test.server, test.file, args...); err == nil || !strings.Contains(err.Error(), test.want) {
			t.Errorf("%q %q: got %v, want %q", test.file, test.flag, err, test.want)
		}
	}
}

func TestArguments(t *testing.T) {
	got := arguments(map[string]string{"v": "1", "root": "/x"}, "v=5", "--more")
	if want := []string{"--root=/x", "--v=1", "--v=5", "--more"}; !slices.Equal(got, want) {
		t.Errorf("got %v, want %v", got, want)
	}
}
