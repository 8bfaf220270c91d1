package main

import (
	"context"
	"errors"
	"fmt"
	"io"
	"net/url"
	"os"
	"slices"
	"strings"
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
	return c.ClusterInit || c.clusterReset || c.ServerURL != "" || exists(c.dataDir.server("db", "etcd"))
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

// etcdName is this member's name, made once, as k3s does: a node that comes
// back with an empty disk is another member.
func (c *config) etcdName() (string, error) {
	path := c.etcdDir("name")
	if content, err := os.ReadFile(path); err == nil {
		return strings.TrimSpace(string(content)), nil
	}
	name := c.NodeName + "-" + randomHex(4)
	if err := os.MkdirAll(c.etcdDir(), 0o700); err != nil {
		return "", err
	}
	_, err := writeFile(path, []byte(name), 0o600)
	return name, err
}

// startEtcd runs the datastore inside this process. initial is the cluster's
// make-up and only read by a member without data.
func startEtcd(ctx context.Context, c *config, initial string, joining bool) (*embed.Etcd, error) {
	if err := c.takeOver(); err != nil {
		return nil, fmt.Errorf("migrating to etcd: %w", err)
	}
	name, err := c.etcdName()
	if err != nil {
		return nil, err
	}
	if err := waitFree(ctx, 2379, 2380); err != nil {
		return nil, err
	}
	cfg := embed.NewConfig()
	cfg.Name = name
	cfg.Dir = c.etcdDir()
	cfg.ListenPeerUrls = urls(c.etcdPeer())
	cfg.AdvertisePeerUrls = cfg.ListenPeerUrls
	cfg.ListenClientUrls = urls(etcdLocal, "https://"+c.NodeIP+":2379")
	cfg.AdvertiseClientUrls = urls("https://" + c.NodeIP + ":2379")
	cfg.InitialCluster = name + "=" + c.etcdPeer()
	if joining {
		cfg.InitialCluster, cfg.ClusterState = initial, embed.ClusterStateFlagExisting
	}
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

func (c *config) etcdClientConfig(endpoints ...string) (clientv3.Config, error) {
	tls, err := transport.TLSInfo{
		CertFile:      c.dataDir.tls("etcd", "client.crt"),
		KeyFile:       c.dataDir.tls("etcd", "client.key"),
		TrustedCAFile: c.dataDir.tls("etcd", "server-ca.crt"),
	}.ClientConfig()
	return clientv3.Config{
		Endpoints: endpoints, TLS: tls, DialTimeout: 5 * time.Second, Logger: zap.NewNop(),
	}, err
}

func (c *config) etcdClient(endpoints ...string) (*clientv3.Client, error) {
	cfg, err := c.etcdClientConfig(endpoints...)
	if err != nil {
		return nil, err
	}
	return clientv3.New(cfg)
}

// addMember announces this server to the running cluster and returns the
// make-up to start with. The member is a learner first, so that a server that
// never comes up costs the cluster no quorum.
func addMember(ctx context.Context, c *config, endpoints []string) (string, error) {
	name, err := c.etcdName()
	if err != nil {
		return "", err
	}
	client, err := c.etcdClient(endpoints...)
	if err != nil {
		return "", err
	}
	defer client.Close()
	ctx, cancel := context.WithTimeout(ctx, 10*time.Second)
	defer cancel()
	list, err := client.MemberList(ctx)
	if err != nil {
		return "", err
	}
	for _, member := range list.Members {
		if !slices.Contains(member.PeerURLs, c.etcdPeer()) {
			continue
		}
		// An earlier life of this host, or an attempt that was cut short.
		logf("info", "Removing etcd member %s at %s, which this server replaces", member.Name, c.etcdPeer())
		if _, err := client.MemberRemove(ctx, member.ID); err != nil {
			return "", err
		}
	}
	added, err := client.MemberAddAsLearner(ctx, []string{c.etcdPeer()})
	if err != nil {
		return "", err
	}
	var initial []string
	for _, member := range added.Members {
		memberName := member.Name
		if member.ID == added.Member.ID {
			memberName = name
		}
		for _, peer := range member.PeerURLs {
			initial = append(initial, memberName+"="+peer)
		}
	}
	return strings.Join(initial, ","), nil
}

// promote makes a learner a voting member once it has caught up.
func promote(ctx context.Context, c *config, server *embed.Etcd, endpoints []string) error {
	id := uint64(server.Server.MemberID())
	if !server.Server.IsLearner() {
		return nil
	}
	client, err := c.etcdClient(endpoints...)
	if err != nil {
		return err
	}
	defer client.Close()
	return poll(ctx, 200*time.Millisecond, 2*time.Minute, func() (bool, error) {
		if !server.Server.IsLearner() {
			return true, nil
		}
		call, cancel := context.WithTimeout(ctx, 5*time.Second)
		defer cancel()
		_, err := client.MemberPromote(call, id)
		return false, err
	})
}
