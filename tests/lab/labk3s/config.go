package main

import (
	"errors"
	"fmt"
	"net"
	"os"
	"path/filepath"
	"slices"
	"sort"
	"strconv"
	"strings"

	"go.yaml.in/yaml/v3"
	utilnet "k8s.io/apimachinery/pkg/util/net"
	netutils "k8s.io/utils/net"
)

// values holds what was given for each option, in order.
type values map[string][]string

// config is the checked configuration of `k3s server` or `k3s agent`.
type config struct {
	server  bool
	dataDir dataDir

	token          string // as given: short or K10 form
	agentToken     string
	serverURL      string
	clusterInit    bool
	clusterReset   bool
	resetRestore   string
	nodeName       string
	nodeIP         string
	nodeLabels     []string
	nodeTaints     []string
	advertise      string
	tlsSANs        []string
	clusterCIDR    string
	serviceCIDR    string
	nodePorts      string
	clusterDNS     string
	clusterDomain  string
	kubeconfig     string
	kubeconfigMode os.FileMode
	noKubeProxy    bool
	storagePath    string
	snapshotDir    string
	snapshotName   string
	protectKernel  bool
	resolvConf     string
	pauseImage     string
	snapshotter    string
	lbPort         string
	verbosity      string

	kubeletArgs, proxyArgs, apiserverArgs, controllerArgs, schedulerArgs []string
}

// loadConfig merges config file, drop-ins, environment and flags as k3s does:
// flags win over files, files over the environment, and a flag replaces the
// whole of a list.
func loadConfig(command string, args, environ []string) (*config, error) {
	on := onServer
	if command == "agent" {
		on = onAgent
	}
	flags, err := parseFlags(command, on, args)
	if err != nil {
		return nil, err
	}
	env, err := parseEnv(on, environ)
	if err != nil {
		return nil, err
	}
	path, must := filepath.Join(etcDir, "config.yaml"), false
	for _, v := range []values{env, flags} {
		if given := v["config"]; len(given) > 0 {
			path, must = given[len(given)-1], true
		}
	}
	files, err := parseFiles(command, on, path, must)
	if err != nil {
		return nil, err
	}
	merged := env
	for _, v := range []values{files, flags} {
		for name, value := range v {
			merged[name] = value
		}
	}
	return buildConfig(on == onServer, merged)
}

// parseFlags reads a command line of `--name value`, `--name=value`, with one
// or two dashes, as k3s's own parser allows.
func parseFlags(command string, on int, args []string) (values, error) {
	got := values{}
	for i := 0; i < len(args); i++ {
		arg := args[i]
		if !strings.HasPrefix(arg, "-") || arg == "-" {
			return nil, fmt.Errorf("k3s %s takes no argument %q", command, arg)
		}
		name, value, hasValue := strings.Cut(strings.TrimLeft(arg, "-"), "=")
		o, err := lookup(command, on, name, "flag --"+name)
		if err != nil {
			return nil, err
		}
		if !hasValue {
			switch {
			case o.kind == flag:
				value = "true"
			case i+1 < len(args):
				i++
				value = args[i]
			default:
				return nil, fmt.Errorf("flag --%s needs a value", o.name)
			}
		}
		if err := got.add(o, "flag --"+o.name, value); err != nil {
			return nil, err
		}
	}
	return got, nil
}

func parseEnv(on int, environ []string) (values, error) {
	byEnv := map[string]*option{}
	for _, o := range options {
		if o.env != "" {
			byEnv[o.env] = o
		}
	}
	got := values{}
	for _, entry := range environ {
		name, value, _ := strings.Cut(entry, "=")
		if !strings.HasPrefix(name, "K3S_") || value == "" {
			continue
		}
		o := byEnv[name]
		switch {
		case o == nil:
			return nil, fmt.Errorf("labk3s has no environment variable %s", name)
		case o.on&on == 0:
			continue // one environment file may serve both commands
		}
		if err := got.add(o, "environment variable "+name, value); err != nil {
			return nil, err
		}
	}
	return got, nil
}

// parseFiles reads config.yaml and then config.yaml.d/*.yaml in order. A later
// file replaces an earlier one's value; a key written `name+` adds to it.
func parseFiles(command string, on int, path string, must bool) (values, error) {
	drops, err := filepath.Glob(path + ".d/*")
	if err != nil {
		return nil, err
	}
	sort.Strings(drops)
	paths := []string{}
	if must || exists(path) {
		paths = append(paths, path)
	}
	for _, drop := range drops {
		if ext := filepath.Ext(drop); ext == ".yaml" || ext == ".yml" {
			paths = append(paths, drop)
		}
	}
	got := values{}
	for _, path := range paths {
		content, err := os.ReadFile(path)
		if err != nil {
			return nil, err
		}
		if err := got.mergeYAML(command, on, path, content); err != nil {
			return nil, err
		}
	}
	return got, nil
}

func (v values) mergeYAML(command string, on int, path string, content []byte) error {
	var doc yaml.Node
	if err := yaml.Unmarshal(content, &doc); err != nil {
		return fmt.Errorf("%s: %w", path, err)
	}
	if len(doc.Content) == 0 {
		return nil
	}
	root := doc.Content[0]
	if root.Kind == yaml.ScalarNode && root.Tag == "!!null" {
		return nil
	}
	if root.Kind != yaml.MappingNode {
		return fmt.Errorf("%s: not a mapping of options", path)
	}
	seen := map[string]bool{}
	for i := 0; i < len(root.Content); i += 2 {
		key, node := root.Content[i].Value, root.Content[i+1]
		name, add := strings.CutSuffix(key, "+")
		where := fmt.Sprintf("%s: key %q", path, name)
		o, err := lookup(command, on, name, where)
		if err != nil {
			return err
		}
		if seen[key] {
			return fmt.Errorf("%s is given twice", where)
		}
		seen[key] = true
		var items []string
		switch {
		case node.Kind == yaml.ScalarNode && node.Tag == "!!null":
			continue
		case node.Kind == yaml.ScalarNode:
			items = []string{node.Value}
		case node.Kind == yaml.SequenceNode && o.kind == list:
			for _, item := range node.Content {
				if item.Kind != yaml.ScalarNode {
					return fmt.Errorf("%s: a list of plain values is wanted", where)
				}
				items = append(items, item.Value)
			}
		default:
			return fmt.Errorf("%s: a plain value is wanted", where)
		}
		fresh := values{}
		for _, item := range items {
			if err := fresh.add(o, where, item); err != nil {
				return err
			}
		}
		if add && o.kind == list {
			v[o.name] = append(slices.Clone(v[o.name]), fresh[o.name]...)
		} else {
			v[o.name] = fresh[o.name]
		}
	}
	return nil
}

// lookup finds an option or says, by its name, why it cannot be had.
func lookup(command string, on int, name, where string) (*option, error) {
	o := options[name]
	if o == nil {
		for _, candidate := range options {
			if candidate.short != "" && candidate.short == name {
				o = candidate
			}
		}
	}
	switch {
	case o == nil:
		return nil, fmt.Errorf("%s is not an option that labk3s has", where)
	case o.on&on == 0:
		return nil, fmt.Errorf("%s is not an option of `k3s %s`", where, command)
	}
	return o, nil
}

func (v values) add(o *option, where, value string) error {
	items := []string{value}
	if o.comma {
		items = strings.Split(value, ",")
	}
	if o.kind == flag {
		b, err := strconv.ParseBool(value)
		if err != nil {
			return fmt.Errorf("%s: %q is neither true nor false", where, value)
		}
		items = []string{strconv.FormatBool(b)}
	}
	for _, item := range items {
		item = strings.TrimSpace(item)
		if item == "" && o.comma {
			continue
		}
		if len(o.only) > 0 && !slices.Contains(o.only, item) {
			return fmt.Errorf("%s: labk3s lacks the value %q (it has %s)", where, item, strings.Join(o.only, ", "))
		}
		if o.kind == list {
			v[o.name] = append(v[o.name], item)
		} else {
			v[o.name] = []string{item}
		}
	}
	return nil
}

func (v values) text(name, fallback string) string {
	if given := v[name]; len(given) > 0 && given[len(given)-1] != "" {
		return given[len(given)-1]
	}
	return fallback
}

func (v values) flag(name string) bool { return v.text(name, "false") == "true" }

// one refuses the second value of an option that labk3s takes one of, such as
// the second address family of a dual-stack cluster.
func (v values) one(name, fallback string) (string, error) {
	if len(v[name]) > 1 {
		return "", fmt.Errorf("labk3s lacks more than one value of %s (dual stack)", name)
	}
	return v.text(name, fallback), nil
}

func buildConfig(server bool, v values) (*config, error) {
	c := &config{
		server:         server,
		dataDir:        dataDir(v.text("data-dir", defaultDataDir)),
		serverURL:      strings.TrimRight(v.text("server", ""), "/"),
		clusterInit:    v.flag("cluster-init"),
		clusterReset:   v.flag("cluster-reset"),
		resetRestore:   v.text("cluster-reset-restore-path", ""),
		nodeName:       v.text("node-name", ""),
		nodeLabels:     v["node-label"],
		nodeTaints:     v["node-taint"],
		advertise:      v.text("advertise-address", ""),
		tlsSANs:        v["tls-san"],
		nodePorts:      v.text("service-node-port-range", "30000-32767"),
		clusterDomain:  v.text("cluster-domain", "cluster.local"),
		kubeconfig:     v.text("write-kubeconfig", filepath.Join(etcDir, "k3s.yaml")),
		noKubeProxy:    v.flag("disable-kube-proxy"),
		snapshotName:   v.text("etcd-snapshot-name", "on-demand"),
		protectKernel:  v.flag("protect-kernel-defaults"),
		resolvConf:     v.text("resolv-conf", ""),
		pauseImage:     v.text("pause-image", "rancher/mirrored-pause:3.6"),
		snapshotter:    v.text("snapshotter", "overlayfs"),
		lbPort:         v.text("lb-server-port", "6444"),
		verbosity:      v.text("v", ""),
		kubeletArgs:    v["kubelet-arg"],
		proxyArgs:      v["kube-proxy-arg"],
		apiserverArgs:  v["kube-apiserver-arg"],
		controllerArgs: v["kube-controller-manager-arg"],
		schedulerArgs:  v["kube-scheduler-arg"],
	}
	c.storagePath = v.text("default-local-storage-path", filepath.Join(string(c.dataDir), "storage"))
	c.snapshotDir = v.text("etcd-snapshot-dir", c.dataDir.server("db", "snapshots"))
	for _, set := range []func() error{
		func() (err error) { c.nodeIP, err = v.one("node-ip", ""); return },
		func() (err error) { c.clusterCIDR, err = v.one("cluster-cidr", "10.42.0.0/16"); return },
		func() (err error) { c.serviceCIDR, err = v.one("service-cidr", "10.43.0.0/16"); return },
		func() (err error) { c.clusterDNS, err = v.one("cluster-dns", ""); return },
		func() (err error) { c.token, err = secretOption(v, "token"); return },
		func() (err error) { c.agentToken, err = secretOption(v, "agent-token"); return },
		func() (err error) { c.kubeconfigMode, err = fileMode(v.text("write-kubeconfig-mode", "0600")); return },
		c.check,
	} {
		if err := set(); err != nil {
			return nil, err
		}
	}
	return c, nil
}

// check fills in what follows from other values and refuses contradictions.
func (c *config) check() error {
	if c.nodeName == "" {
		name, err := os.Hostname()
		if err != nil {
			return err
		}
		c.nodeName = strings.ToLower(name)
	}
	if c.nodeIP == "" {
		ip, err := utilnet.ChooseHostInterface() // as k3s does
		if err != nil {
			return fmt.Errorf("no address found for this node; give node-ip: %w", err)
		}
		c.nodeIP = ip.String()
	}
	if net.ParseIP(c.nodeIP) == nil {
		return fmt.Errorf("node-ip: %q is not an address", c.nodeIP)
	}
	if c.advertise == "" {
		c.advertise = c.nodeIP
	}
	_, services, err := net.ParseCIDR(c.serviceCIDR)
	if err != nil {
		return fmt.Errorf("service-cidr: %w", err)
	}
	if _, _, err := net.ParseCIDR(c.clusterCIDR); err != nil {
		return fmt.Errorf("cluster-cidr: %w", err)
	}
	if c.clusterDNS == "" {
		ip, err := netutils.GetIndexedIP(services, 10)
		if err != nil {
			return fmt.Errorf("service-cidr: %w", err)
		}
		c.clusterDNS = ip.String()
	}
	if !c.server && c.serverURL == "" {
		return errors.New("--server is required")
	}
	if !c.server && c.token == "" {
		return errors.New("--token is required")
	}
	if c.serverURL != "" && !strings.HasPrefix(c.serverURL, "https://") {
		return fmt.Errorf("server: %q is not an https:// URL", c.serverURL)
	}
	if c.server && c.serverURL != "" && c.token == "" {
		return errors.New("--token is required to join another server")
	}
	if c.resetRestore != "" && !c.clusterReset {
		return errors.New("invalid flag use; --cluster-reset required with --cluster-reset-restore-path")
	}
	if c.clusterReset && c.serverURL != "" {
		return errors.New("invalid flag use; --server is not allowed with --cluster-reset")
	}
	return nil
}

// secretOption reads an option that can also be given as a file.
func secretOption(v values, name string) (string, error) {
	if value := v.text(name, ""); value != "" {
		return value, nil
	}
	path := v.text(name+"-file", "")
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

func fileMode(value string) (os.FileMode, error) {
	mode, err := strconv.ParseUint(strings.TrimPrefix(value, "0o"), 8, 32)
	if err != nil || mode > 0o777 {
		return 0, fmt.Errorf("write-kubeconfig-mode: %q is not a file mode", value)
	}
	return os.FileMode(mode), nil
}

// mergeArgs lays a component's extra `key=value` arguments over our own: an
// extra one replaces ours, `key+=value` adds to it, and a key that is given
// several times keeps all its values.
func mergeArgs(base map[string]string, extra []string) ([]string, error) {
	merged := map[string][]string{}
	for key, value := range base {
		merged[key] = []string{value}
	}
	replaced := map[string]bool{}
	for _, arg := range extra {
		key, value, ok := strings.Cut(strings.TrimLeft(arg, "-"), "=")
		if !ok {
			value = "true"
		}
		plain, add := strings.CutSuffix(key, "+")
		switch {
		case strings.HasSuffix(key, "-"):
			return nil, fmt.Errorf("labk3s lacks the removal of arguments (%q)", arg)
		case plain == "config":
			return nil, fmt.Errorf("labk3s lacks a configuration file of one's own for a component (%q)", arg)
		case add && len(merged[plain]) > 0:
			last := len(merged[plain]) - 1
			merged[plain] = append(slices.Clone(merged[plain][:last]), merged[plain][last]+","+value)
		case replaced[plain]:
			merged[plain] = append(merged[plain], value)
		default:
			merged[plain], replaced[plain] = []string{value}, true
		}
	}
	var args []string
	for key, all := range merged {
		for _, value := range all {
			args = append(args, "--"+key+"="+value)
		}
	}
	sort.Strings(args)
	return args, nil
}
