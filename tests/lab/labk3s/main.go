// Command k3s here is labk3s: a stand-in for the k3s release binary, for test
// labs that have package registries but no release downloads. It is made of
// the unmodified upstream Kubernetes and etcd modules and speaks the part of
// k3s's contract that README.md lists. What it lacks it refuses by name.
package main

import (
	"errors"
	"fmt"
	"os"
	"path/filepath"
	"runtime"
	"strings"
	"sync/atomic"
	_ "time/tzdata" // time zones of CronJobs, as upstream's binaries have them
	_ "unsafe"      // for go:linkname

	_ "k8s.io/component-base/version"
)

// version is set by the linker: -X main.version=v1.34.2+lab1
var version = "v1.34.2+lab0"

// Upstream sets these with linker flags of their own. Taking them from our
// version keeps "+lab1" and "+lab2" one single flag apart, and makes nodes
// report the version that `k3s --version` prints, as real k3s does.
//
//go:linkname kubeDynamicVersion k8s.io/component-base/version.dynamicGitVersion
var kubeDynamicVersion atomic.Value

//go:linkname kubeMajor k8s.io/component-base/version.gitMajor
var kubeMajor string

//go:linkname kubeMinor k8s.io/component-base/version.gitMinor
var kubeMinor string

func init() {
	kubeDynamicVersion.Store(version)
	if parts := strings.SplitN(strings.TrimPrefix(version, "v"), ".", 3); len(parts) == 3 {
		kubeMajor, kubeMinor = parts[0], parts[1]
	}
}

func main() {
	// k3s works under other names as well, through links to it.
	args := os.Args[1:]
	switch name := filepath.Base(os.Args[0]); name {
	case "kubectl", "ctr", "crictl":
		args = append([]string{name}, args...)
	}
	if err := run(args); err != nil {
		var code exitCode
		if errors.As(err, &code) {
			os.Exit(int(code))
		}
		logf("fatal", "%v", err)
		os.Exit(1)
	}
}

// exitCode ends the program with a status and nothing more to say.
type exitCode int

func (c exitCode) Error() string { return fmt.Sprintf("exit status %d", int(c)) }

func run(args []string) error {
	if len(args) == 0 {
		return errors.New("labk3s wants a command")
	}
	command, rest := args[0], args[1:]
	switch command {
	case "--version", "-v", "version":
		fmt.Printf("k3s version %s (labk3s, a test stand-in)\ngo version %s\n", version, runtime.Version())
		return nil
	case "server":
		return serverCommand(rest)
	case "agent":
		return agentCommand(rest)
	case "kubectl":
		return kubectlCommand(rest)
	case "ctr":
		return ctrCommand(rest)
	case "crictl":
		return crictlCommand(rest)
	case "etcd-snapshot":
		return snapshotCommand(rest)
	case "token":
		return tokenCommand(rest)
	case "certificate":
		return certificateCommand(defaultDataDir, rest)
	}
	if component, ok := components[command]; ok {
		return component(rest)
	}
	return fmt.Errorf("labk3s has no command %q", command)
}
