package main

import (
	"context"
	"errors"
	"fmt"
	"os"
	"os/exec"
	"path/filepath"
	"runtime"
	"slices"
	"strconv"
	"strings"
	"sync"
	"syscall"
	"time"

	"github.com/coreos/go-systemd/v22/daemon"
)

// processes are the children of one labk3s: Kubernetes components keep global
// state, so each is a process of its own, of this same binary. None of them
// outlives the parent, and the parent does not outlive any of them: systemd's
// restart then brings back the whole, which is the one state that is tested.
type processes struct {
	mu       sync.Mutex
	children []*child
	stopping bool
	died     chan error
}

type child struct {
	name string
	cmd  *exec.Cmd
	done chan struct{}
}

func newProcesses() *processes {
	return &processes{died: make(chan error, 16)}
}

const stopGrace = 5 * time.Second

// component starts this binary again as one of its components.
func (p *processes) component(name string, args []string) error {
	// The running file, not its path: an upgrade may have replaced that.
	return p.start(name, "/proc/self/exe", append([]string{"k3s", name}, args...), os.Stderr)
}

// program starts a program of the host, with a log file of its own.
func (p *processes) program(logFile, path string, args ...string) error {
	log, err := os.OpenFile(logFile, os.O_CREATE|os.O_WRONLY|os.O_APPEND|os.O_TRUNC, 0o600)
	if err != nil {
		return err
	}
	defer log.Close()
	return p.start(filepath.Base(path), path, append([]string{path}, args...), log)
}

func (p *processes) start(name, path string, argv []string, log *os.File) error {
	cmd := &exec.Cmd{
		Path: path, Args: argv, Env: childEnv(), Stdout: log, Stderr: log,
		SysProcAttr: &syscall.SysProcAttr{Pdeathsig: syscall.SIGKILL},
	}
	c := &child{name: name, cmd: cmd, done: make(chan struct{})}
	started := make(chan error)
	go func() {
		// The kernel sends the death signal when the *thread* that forked
		// ends, so this one must live as long as the child.
		runtime.LockOSThread()
		defer runtime.UnlockOSThread()
		p.mu.Lock()
		if p.stopping {
			p.mu.Unlock()
			started <- context.Canceled
			return
		}
		err := cmd.Start()
		if err == nil {
			p.children = append(p.children, c)
		}
		p.mu.Unlock()
		started <- err
		if err != nil {
			return
		}
		err = cmd.Wait()
		close(c.done)
		p.mu.Lock()
		stopping := p.stopping
		p.mu.Unlock()
		if !stopping {
			if err == nil {
				err = errors.New("exit status 0")
			}
			p.died <- fmt.Errorf("%s exited: %w", name, err)
		}
	}()
	if err := <-started; err != nil {
		return fmt.Errorf("starting %s: %w", name, err)
	}
	logf("info", "Running %s %s", name, strings.Join(argv[1:], " "))
	return nil
}

// stop ends the named children together and waits for them.
func (p *processes) stop(names ...string) {
	p.mu.Lock()
	p.stopping = true
	var picked []*child
	for _, c := range p.children {
		if len(names) == 0 || slices.Contains(names, c.name) {
			picked = append(picked, c)
			_ = c.cmd.Process.Signal(syscall.SIGTERM)
		}
	}
	p.mu.Unlock()
	deadline := time.After(stopGrace)
	for _, c := range picked {
		select {
		case <-c.done:
		case <-deadline:
			logf("warning", "%s did not stop in %s, killing it", c.name, stopGrace)
			for _, late := range picked {
				_ = late.cmd.Process.Kill()
			}
			<-c.done
		}
	}
}

// childEnv keeps from children what is meant for us: systemd's notify socket
// (the unit accepts only the main process) and our secrets.
func childEnv() []string {
	return slices.DeleteFunc(os.Environ(), func(entry string) bool {
		return strings.HasPrefix(entry, "NOTIFY_SOCKET=") || strings.HasPrefix(entry, "K3S_")
	})
}

// waitFree waits until nobody listens on these ports: a predecessor that was
// killed may take a moment to give them back. It looks instead of trying: a
// listener opened for a trial lives on for a moment in children that are just
// being forked, and is then itself what takes the port.
func waitFree(ctx context.Context, ports ...int) error {
	return poll(ctx, 100*time.Millisecond, 15*time.Second, func() (bool, error) {
		for _, table := range []string{"/proc/net/tcp", "/proc/net/tcp6"} {
			content, err := os.ReadFile(table)
			if err != nil && !errors.Is(err, os.ErrNotExist) {
				return true, err
			}
			for _, port := range listeningPorts(string(content)) {
				if slices.Contains(ports, port) {
					return false, fmt.Errorf("port %d is taken", port)
				}
			}
		}
		return true, nil
	})
}

// listeningPorts reads the kernel's table of TCP sockets.
func listeningPorts(table string) []int {
	const listening = "0A"
	var ports []int
	for _, line := range strings.Split(table, "\n") {
		fields := strings.Fields(line)
		if len(fields) < 4 || fields[3] != listening {
			continue
		}
		_, hex, _ := strings.Cut(fields[1], ":")
		if port, err := strconv.ParseUint(hex, 16, 16); err == nil {
			ports = append(ports, int(port))
		}
	}
	return ports
}

// poll calls check until it says true; a limit of 0 means for ever. Its error
// is the last thing check said.
func poll(ctx context.Context, every, limit time.Duration, check func() (bool, error)) error {
	var deadline <-chan time.Time
	if limit > 0 {
		deadline = time.After(limit)
	}
	ticker := time.NewTicker(every)
	defer ticker.Stop()
	for {
		done, err := check()
		if done {
			return err
		}
		select {
		case <-ctx.Done():
			return ctx.Err()
		case <-deadline:
			if err == nil {
				err = fmt.Errorf("not within %s", limit)
			}
			return err
		case <-ticker.C:
		}
	}
}

// notify tells systemd a state, where it asked to be told.
func notify(state string) {
	if _, err := daemon.SdNotify(false, state); err != nil {
		logf("warning", "sd_notify: %v", err)
	}
}
