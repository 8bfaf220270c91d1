package main

import (
	"context"
	"errors"
	"fmt"
	"os"
	"os/signal"
	"path/filepath"
	"slices"
	"strings"
	"syscall"
	"time"

	"go.etcd.io/etcd/etcdutl/v3/snapshot"
	"go.uber.org/zap"
)

// snapshotCommand is `k3s etcd-snapshot save`. It talks to this host's etcd
// itself; k3s asks its own supervisor, with the same outcome.
func snapshotCommand(args []string) error {
	if len(args) == 0 || args[0] != "save" {
		return fmt.Errorf("labk3s lacks `k3s etcd-snapshot %s` (it has save)", strings.Join(args, " "))
	}
	flags := slices.Clone(args[1:])
	for i, flag := range flags {
		if flag == "--name" { // short for the option of k3s
			flags[i] = "--etcd-snapshot-name"
		}
	}
	c, err := loadConfig("server", flags, os.Environ())
	if err != nil {
		return err
	}
	if !c.managed() {
		return errors.New("etcd datastore disabled: this server runs without cluster-init")
	}
	ctx, stop := signal.NotifyContext(context.Background(), syscall.SIGTERM, syscall.SIGINT)
	defer stop()
	return saveSnapshot(ctx, c)
}

func saveSnapshot(ctx context.Context, c *config) error {
	cfg, err := c.etcdClientConfig(etcdLocal)
	if err != nil {
		return fmt.Errorf("is this a running server? %w", err)
	}
	if err := os.MkdirAll(c.snapshotDir, 0o700); err != nil {
		return err
	}
	name := fmt.Sprintf("%s-%s-%d", c.snapshotName, c.nodeName, time.Now().Unix())
	path := filepath.Join(c.snapshotDir, name)
	ctx, cancel := context.WithTimeout(ctx, 2*time.Minute)
	defer cancel()
	if _, err := snapshot.NewV3(zap.NewNop()).Save(ctx, cfg, path); err != nil {
		return fmt.Errorf("failed to save the snapshot: %w", err)
	}
	if err := os.Chmod(path, 0o600); err != nil {
		return err
	}
	logf("info", "Snapshot %s saved.", name)
	return nil
}

// resetFlag keeps a service that was left with --cluster-reset in its
// configuration from resetting its cluster over and over.
func (c *config) resetFlag() string { return c.dataDir.server("db", "reset-flag") }

// clusterReset is `k3s server --cluster-reset`: it leaves a cluster of this
// one server, with the data it has or with a snapshot's, and ends.
func clusterReset(ctx context.Context, c *config) error {
	flag := c.resetFlag()
	if exists(flag) {
		return fmt.Errorf("Managed etcd cluster membership was previously reset, please remove the cluster-reset flag and start k3s normally. "+
			"If you need to perform another cluster reset, you must first manually delete the file at %s", flag)
	}
	secret, err := prepareServer(ctx, c)
	if err != nil {
		return err
	}
	if c.resetRestore != "" {
		if err := restoreSnapshot(c); err != nil {
			return err
		}
	} else if !c.etcdInitialised() {
		return errors.New("there is no etcd data on this server to reset to; give --cluster-reset-restore-path")
	}
	cas, err := ensureCAs(c.dataDir)
	if err != nil {
		return err
	}
	if err := serverLeaves(c, cas); err != nil {
		return err
	}
	server, err := startEtcd(ctx, c, "", false, true)
	if err != nil {
		return err
	}
	defer server.Close()
	client, err := c.etcdClient(etcdLocal)
	if err != nil {
		return err
	}
	defer client.Close()
	// The data's own authorities: on an empty host those made above are
	// nobody's.
	stored, err := loadBootstrap(ctx, client, secret)
	if err != nil {
		return err
	}
	if stored != nil {
		if _, err := stored.write(c.dataDir); err != nil {
			return err
		}
	}
	if cas, err = ensureCAs(c.dataDir); err != nil {
		return err
	}
	if _, err := writeTokens(c, cas, secret); err != nil {
		return err
	}
	if _, err := writeFile(flag, nil, 0o600); err != nil {
		return err
	}
	logf("info", "Managed etcd cluster membership has been reset, restart without --cluster-reset flag now. "+
		"Backup and delete %s on each peer etcd server and rejoin the nodes", c.dataDir.server("db"))
	return nil
}

func restoreSnapshot(c *config) error {
	path := strings.TrimPrefix(c.resetRestore, "file://")
	if !exists(path) {
		return fmt.Errorf("etcd: snapshot path does not exist: %s", path)
	}
	name, err := c.etcdName()
	if err != nil {
		return err
	}
	restored := c.etcdDir() + "-restore"
	if err := os.RemoveAll(restored); err != nil {
		return err
	}
	err = snapshot.NewV3(zap.NewNop()).Restore(snapshot.RestoreConfig{
		SnapshotPath: path, Name: name, OutputDataDir: restored,
		PeerURLs: []string{c.etcdPeer()}, InitialCluster: name + "=" + c.etcdPeer(), InitialClusterToken: "etcd-cluster",
		// Watchers that saw later revisions must notice that time went back.
		RevisionBump: 1_000_000, MarkCompacted: true,
	})
	if err != nil {
		return fmt.Errorf("restoring %s: %w", path, err)
	}
	if err := moveAside(c.etcdDir()); err != nil {
		return err
	}
	if err := os.Rename(restored, c.etcdDir()); err != nil {
		return err
	}
	_, err = writeFile(c.etcdDir("name"), []byte(name), 0o600)
	return err
}
