package main

import (
	"context"
	"errors"
	"io"
	"net"
	"time"
)

// loadBalancer is an agent's way to its server: everything on the agent talks
// to 127.0.0.1:6444, as with k3s. Here there is one server alone.
type loadBalancer struct{ server string }

func (lb loadBalancer) serve(ctx context.Context, address string) error {
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

func (lb loadBalancer) forward(client net.Conn) {
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

func (lb loadBalancer) dial(ctx context.Context) (net.Conn, error) {
	dialer := net.Dialer{Timeout: 3 * time.Second}
	return dialer.DialContext(ctx, "tcp", lb.server)
}

func closeWrite(conn net.Conn) {
	if tcp, ok := conn.(*net.TCPConn); ok {
		_ = tcp.CloseWrite()
	}
}
