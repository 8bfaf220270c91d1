package main

import (
	"context"
	"encoding/json"
	"errors"
	"io"
	"net"
	"os"
	"slices"
	"sync"
	"time"
)

// loadBalancer is an agent's way to the servers: everything on the agent talks
// to 127.0.0.1:6444, which goes to a server that answers. It remembers the
// servers on disk, so that an agent starts even when the one in its
// configuration is gone.
type loadBalancer struct {
	file    string
	first   string // from the configuration
	mu      sync.Mutex
	servers []string
}

func newLoadBalancer(file, first string) *loadBalancer {
	lb := &loadBalancer{file: file, first: first, servers: []string{first}}
	var saved []string
	if content, err := os.ReadFile(file); err == nil && json.Unmarshal(content, &saved) == nil {
		lb.servers = withFirst(saved, first)
	}
	return lb
}

func withFirst(servers []string, first string) []string {
	merged := []string{first}
	for _, server := range servers {
		if !slices.Contains(merged, server) {
			merged = append(merged, server)
		}
	}
	return merged
}

// update takes the servers that the cluster has now.
func (lb *loadBalancer) update(servers []string) {
	if len(servers) == 0 {
		return
	}
	lb.mu.Lock()
	defer lb.mu.Unlock()
	next := withFirst(servers, lb.first)
	if slices.Equal(slices.Sorted(slices.Values(next)), slices.Sorted(slices.Values(lb.servers))) {
		return
	}
	logf("info", "Updated load balancer server addresses -> %v", next)
	lb.servers = next
	content, err := json.Marshal(next)
	if err == nil {
		_, err = writeFile(lb.file, content, 0o600)
	}
	if err != nil {
		logf("warning", "saving the load balancer's servers: %v", err)
	}
}

func (lb *loadBalancer) serve(ctx context.Context, address string) error {
	var listener net.Listener
	err := poll(ctx, 100*time.Millisecond, 15*time.Second, func() (done bool, err error) {
		listener, err = net.Listen("tcp", address)
		return err == nil, err
	})
	if err != nil {
		return err
	}
	go func() {
		<-ctx.Done()
		listener.Close()
	}()
	go func() {
		for {
			conn, err := listener.Accept()
			if errors.Is(err, net.ErrClosed) {
				return
			}
			if err != nil {
				time.Sleep(50 * time.Millisecond) // out of descriptors
				continue
			}
			go lb.forward(conn)
		}
	}()
	return nil
}

func (lb *loadBalancer) forward(client net.Conn) {
	defer client.Close()
	server, err := lb.dial(context.Background())
	if err != nil {
		return
	}
	defer server.Close()
	go func() {
		_, _ = io.Copy(server, client)
		closeWrite(server)
	}()
	_, _ = io.Copy(client, server)
}

// dial takes the first server that answers and puts those that did not behind
// it, so that the next connection does not wait for them again.
func (lb *loadBalancer) dial(ctx context.Context) (net.Conn, error) {
	lb.mu.Lock()
	servers := slices.Clone(lb.servers)
	lb.mu.Unlock()
	dialer := net.Dialer{Timeout: 3 * time.Second}
	var failed []error
	for i, server := range servers {
		conn, err := dialer.DialContext(ctx, "tcp", server)
		if err != nil {
			failed = append(failed, err)
			continue
		}
		if i > 0 {
			lb.mu.Lock()
			if len(lb.servers) == len(servers) {
				lb.servers = append(slices.Clone(servers[i:]), servers[:i]...)
			}
			lb.mu.Unlock()
		}
		return conn, nil
	}
	return nil, errors.Join(failed...)
}

func closeWrite(conn net.Conn) {
	if tcp, ok := conn.(*net.TCPConn); ok {
		_ = tcp.CloseWrite()
	}
}
