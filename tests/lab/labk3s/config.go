package main

import (
	"errors"
	"flag"
	"fmt"
	"io"
	"net"
	"os"
	"slices"
	"strings"

	utilnet "k8s.io/apimachinery/pkg/util/net"
	"sigs.k8s.io/yaml"
)

// config is the checked configuration of `k3s server` or `k3s agent`. Its keys
// of config.yaml are those that the roles and the tests give; every other one
// of k3s's is an error that names it.
type config struct {
	TokenFile         string   `json:"token-file"`
	AgentTokenFile    string   `json:"agent-token-file"`
	ServerURL         string   `json:"server"`
	ClusterInit       bool     `json:"cluster-init"`
	NodeName          string   `json:"node-name"`
	NodeIP            string   `json:"node-ip"`
	TLSSANs           []string `json:"tls-san"`
	KubeconfigMode    string   `json:"write-kubeconfig-mode"`
	Disable           []string `json:"disable"`
	KubeletArgs       []string `json:"kubelet-arg"`
	APIServerArgs     []string `json:"kube-apiserver-arg"`
	ControllerArgs    []string `json:"kube-controller-manager-arg"`
	ProtectKernel     bool     `json:"protect-kernel-defaults"`
	SecretsEncryption bool     `json:"secrets-encryption"`

	server       bool
	dataDir      dataDir
	clusterReset bool
	resetRestore string
	token        string // as given: short or K10 form
	agentToken   string
}

// loadConfig reads the file and, of a server, the flags of a cluster's reset.
func loadConfig(server bool, path string, args []string) (*config, error) {
	for _, entry := range os.Environ() {
		if strings.HasPrefix(entry, "K3S_") {
			name, _, _ := strings.Cut(entry, "=")
			return nil, fmt.Errorf("labk3s has no environment variable %s", name)
		}
	}
	c := &config{server: server, dataDir: defaultDataDir, KubeconfigMode: "0600"}
	content, err := os.ReadFile(path)
	if err == nil {
		err = yaml.UnmarshalStrict(content, c)
	}
	if err != nil && !errors.Is(err, os.ErrNotExist) {
		return nil, fmt.Errorf("labk3s: %s: %w", path, err)
	}
	flags := flag.NewFlagSet("k3s", flag.ContinueOnError)
	flags.SetOutput(io.Discard)
	if server {
		flags.BoolVar(&c.clusterReset, "cluster-reset", false, "")
		flags.StringVar(&c.resetRestore, "cluster-reset-restore-path", "", "")
	}
	if err := flags.Parse(args); err != nil {
		return nil, fmt.Errorf("labk3s: %w", err)
	}
	if flags.NArg() > 0 {
		return nil, fmt.Errorf("k3s takes no argument %q", flags.Arg(0))
	}
	return c, c.check()
}

// check fills in what follows from other values and refuses contradictions.
func (c *config) check() (err error) {
	if c.token, err = secretFile("token", c.TokenFile); err != nil {
		return err
	}
	if c.agentToken, err = secretFile("agent-token", c.AgentTokenFile); err != nil {
		return err
	}
	if c.NodeIP == "" {
		ip, err := utilnet.ChooseHostInterface() // as k3s does
		if err != nil {
			return fmt.Errorf("no address found for this node; give node-ip: %w", err)
		}
		c.NodeIP = ip.String()
	}
	c.ServerURL = strings.TrimRight(c.ServerURL, "/")
	switch {
	case c.KubeconfigMode != "0600":
		return fmt.Errorf("write-kubeconfig-mode: labk3s lacks the value %q", c.KubeconfigMode)
	case c.NodeName == "":
		return errors.New("node-name is required")
	case net.ParseIP(c.NodeIP) == nil:
		return fmt.Errorf("node-ip: %q is not one address", c.NodeIP)
	case !c.server && c.ServerURL == "":
		return errors.New("--server is required")
	case !c.server && (c.SecretsEncryption || len(c.APIServerArgs)+len(c.ControllerArgs) > 0):
		return errors.New("secrets-encryption, kube-apiserver-arg and kube-controller-manager-arg are for servers")
	case c.server && c.ServerURL != "":
		return errors.New("server: labk3s lacks a server that joins another one")
	case c.ServerURL != "" && c.token == "":
		return errors.New("--token is required")
	case c.ServerURL != "" && !strings.HasPrefix(c.ServerURL, "https://"):
		return fmt.Errorf("server: %q is not an https:// URL", c.ServerURL)
	case c.clusterReset != (c.resetRestore != ""):
		return errors.New("labk3s lacks --cluster-reset without --cluster-reset-restore-path, and the other way around")
	}
	for _, part := range c.Disable { // nothing of these exists here
		if !slices.Contains([]string{"servicelb", "traefik", "metrics-server", "runtimes"}, part) {
			return fmt.Errorf("disable: labk3s lacks the value %q", part)
		}
	}
	return nil
}

func secretFile(name, path string) (string, error) {
	if path == "" {
		return "", nil
	}
	content, err := os.ReadFile(path)
	if err != nil {
		return "", fmt.Errorf("%s-file: %w", name, err)
	}
	secret := strings.TrimSpace(string(content))
	if secret == "" {
		return "", fmt.Errorf("%s-file: %s is empty", name, path)
	}
	return secret, nil
}

// arguments are a component's own, and after them those that are to win.
func arguments(own map[string]string, more ...string) []string {
	var args []string
	for key, value := range own {
		args = append(args, "--"+key+"="+value)
	}
	slices.Sort(args)
	for _, arg := range more {
		args = append(args, "--"+strings.TrimLeft(arg, "-"))
	}
	return args
}
