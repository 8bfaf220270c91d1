package main

import (
	"os"
	"path/filepath"
)

const (
	defaultDataDir   = "/var/lib/rancher/k3s"
	etcDir           = "/etc/rancher/k3s"
	nodePasswordFile = "/etc/rancher/node/password"
	containerdSocket = "/run/k3s/containerd/containerd.sock"
	containerdState  = "/run/k3s/containerd"
	cniBinDir        = "/usr/lib/cni"
	kubeletDir       = "/var/lib/kubelet"
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
