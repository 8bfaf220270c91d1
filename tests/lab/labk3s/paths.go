package main

import (
	"os"
	"path/filepath"
)

const (
	defaultDataDir   = "/var/lib/rancher/k3s"
	etcDir           = "/etc/rancher/k3s"
	configFile       = etcDir + "/config.yaml"
	kubeconfigFile   = etcDir + "/k3s.yaml"
	nodePasswordFile = "/etc/rancher/node/password"
	containerdSocket = "/run/k3s/containerd/containerd.sock"
	containerdState  = "/run/k3s/containerd"
	cniBinDir        = "/usr/lib/cni"
	kubeletDir       = "/var/lib/kubelet"
)

// k3s's own, where nobody says otherwise.
const (
	clusterCIDR   = "10.42.0.0/16"
	serviceCIDR   = "10.43.0.0/16"
	serviceAPI    = "10.43.0.1"
	clusterDNS    = "10.43.0.10"
	clusterDomain = "cluster.local"
	balancer      = "127.0.0.1:6444"
)

// dataDir is k3s's --data-dir; its layout below is k3s's as well.
type dataDir string

func (d dataDir) server(parts ...string) string {
	return filepath.Join(append([]string{string(d), "server"}, parts...)...)
}

func (d dataDir) tls(parts ...string) string {
	return filepath.Join(append([]string{string(d), "server", "tls"}, parts...)...)
}

func (d dataDir) agent(parts ...string) string {
	return filepath.Join(append([]string{string(d), "agent"}, parts...)...)
}

// storage is where the volumes of the class local-path are.
func (d dataDir) storage() string { return filepath.Join(string(d), "storage") }

// writeFile replaces a file in one step, so that a reader or a crash never
// sees half of it. It reports whether the content changed.
func writeFile(path string, content []byte, mode os.FileMode) (bool, error) {
	if old, err := os.ReadFile(path); err == nil && string(old) == string(content) {
		return false, os.Chmod(path, mode)
	}
	if err := os.MkdirAll(filepath.Dir(path), 0o755); err != nil {
		return false, err
	}
	tmp, err := os.CreateTemp(filepath.Dir(path), "."+filepath.Base(path)+".*")
	if err != nil {
		return false, err
	}
	defer os.Remove(tmp.Name())
	if _, err := tmp.Write(content); err != nil {
		tmp.Close()
		return false, err
	}
	if err := tmp.Close(); err != nil {
		return false, err
	}
	if err := os.Chmod(tmp.Name(), mode); err != nil {
		return false, err
	}
	return true, os.Rename(tmp.Name(), path)
}

func exists(path string) bool {
	_, err := os.Stat(path)
	return err == nil
}
