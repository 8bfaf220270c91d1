package main

import (
	"context"
	"errors"
	"fmt"
	"io"
	"net/url"
	"os"
	"time"

	"go.etcd.io/etcd/client/pkg/v3/transport"
	clientv3 "go.etcd.io/etcd/client/v3"
	"go.etcd.io/etcd/server/v3/embed"
	"go.uber.org/zap"
	"google.golang.org/grpc/grpclog"
)

func init() {
	// gRPC warns of every connection that is closed while it is being made,
	// which etcd's client does all the time; its errors come back from calls.
	grpclog.SetLoggerV2(grpclog.NewLoggerV2(io.Discard, io.Discard, os.Stderr))
}

const etcdLocal = "https://127.0.0.1:2379"

// managed says whether the datastore is k3s's embedded etcd: asked for, or on
// the disk already, as in k3s. A server without has SQLite in k3s.
func (c *config) managed() bool {
	return c.ClusterInit || c.clusterReset || exists(c.dataDir.server("db", "etcd"))
}

// etcdDir is where the datastore's files are. Of a server that k3s would give
// SQLite they are at the path of k3s's database file: a stand-in, for there is
// no SQLite here. It is an etcd, too, but of this server alone.
func (c *config) etcdDir(parts ...string) string {
	kind := "state.db"
	if c.managed() {
		kind = "etcd"
	}
	return c.dataDir.server(append([]string{"db", kind}, parts...)...)
}

// takeOver brings what a server without cluster-init has kept into its new
// etcd, and leaves the old database aside, as k3s does.
func (c *config) takeOver() error {
	old := c.dataDir.server("db", "state.db")
	if !c.ClusterInit || c.clusterReset || c.etcdInitialised() || !exists(old) {
		return nil
	}
	logf("info", "Migrating content from sqlite to etcd")
	if err := os.RemoveAll(c.etcdDir()); err != nil {
		return err
	}
	if err := os.CopyFS(c.etcdDir(), os.DirFS(old)); err != nil {
		return err
	}
	return os.Rename(old, old+".migrated")
}

func (c *config) etcdPeer() string { return "https://" + c.NodeIP + ":2380" }

func (c *config) etcdInitialised() bool { return exists(c.etcdDir("member", "wal")) }

// startEtcd runs the datastore inside this process.
func startEtcd(ctx context.Context, c *config) (*embed.Etcd, error) {
	if err := c.takeOver(); err != nil {
		return nil, fmt.Errorf("migrating to etcd: %w", err)
	}
	if err := waitFree(ctx, 2379, 2380); err != nil {
		return nil, err
	}
	cfg := embed.NewConfig()
	cfg.Name = c.NodeName
	cfg.Dir = c.etcdDir()
	cfg.ListenPeerUrls = urls(c.etcdPeer())
	cfg.AdvertisePeerUrls = cfg.ListenPeerUrls
	cfg.ListenClientUrls = urls(etcdLocal, "https://"+c.NodeIP+":2379")
	cfg.AdvertiseClientUrls = urls("https://" + c.NodeIP + ":2379")
	cfg.InitialCluster = c.NodeName + "=" + c.etcdPeer()
	cfg.ClientTLSInfo = c.etcdTLS("server-ca", "server-client")
	cfg.PeerTLSInfo = c.etcdTLS("peer-ca", "peer-server-client")
	cfg.TickMs, cfg.ElectionMs = 100, 1000
	cfg.Logger, cfg.LogLevel, cfg.LogOutputs = "zap", "warn", []string{"stderr"}
	// NewConfig leaves it at zero, which is a warning for every request.
	cfg.WarningUnaryRequestDuration = embed.DefaultWarningUnaryRequestDuration
	// A lab host is a container: it cannot lose power without the machine, and
	// with the machine the whole lab is gone.
	cfg.UnsafeNoFsync = true
	server, err := embed.StartEtcd(cfg)
	if err != nil {
		return nil, fmt.Errorf("starting etcd: %w", err)
	}
	select {
	case <-server.Server.ReadyNotify():
		return server, nil
	case err := <-server.Err():
		return nil, fmt.Errorf("etcd: %w", err)
	case <-server.Server.StopNotify():
		return nil, errors.New("etcd stopped while it started")
	case <-ctx.Done():
		server.Close()
		return nil, ctx.Err()
	}
}

func (c *config) etcdTLS(ca, pair string) transport.TLSInfo {
	return transport.TLSInfo{
		CertFile:       c.dataDir.tls("etcd", pair+".crt"),
		KeyFile:        c.dataDir.tls("etcd", pair+".key"),
		TrustedCAFile:  c.dataDir.tls("etcd", ca+".crt"),
		ClientCertAuth: true,
	}
}

func urls(all ...string) []url.URL {
	var parsed []url.URL
	for _, one := range all {
		u, err := url.Parse(one)
		if err != nil {
			panic(err) // built from an address that was checked
		}
		parsed = append(parsed, *u)
	}
	return parsed
}

func (c *config) etcdClientConfig() (clientv3.Config, error) {
	tls, err := transport.TLSInfo{
		CertFile:      c.dataDir.tls("etcd", "client.crt"),
		KeyFile:       c.dataDir.tls("etcd", "client.key"),
		TrustedCAFile: c.dataDir.tls("etcd", "server-ca.crt"),
	}.ClientConfig()
	return clientv3.Config{
		Endpoints: []string{etcdLocal}, TLS: tls, DialTimeout: 5 * time.Second, Logger: zap.NewNop(),
	}, err
}
