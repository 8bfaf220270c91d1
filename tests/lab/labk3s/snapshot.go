package main

import (
	"context"
	"errors"
	"flag"
	"fmt"
	"os"
	"os/signal"
	"path/filepath"
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
	c, err := loadConfig(true, configFile, nil)
	if err != nil {
		return err
	}
	flags := flag.NewFlagSet("k3s etcd-snapshot save", flag.ContinueOnError)
	name := flags.String("name", "on-demand", "")
	dir := flags.String("etcd-snapshot-dir", c.dataDir.server("db", "snapshots"), "")
	if err := flags.Parse(args[1:]); err != nil {
		return err
	}
	if !c.managed() {
		return errors.New("etcd datastore disabled: this server runs without cluster-init")
	}
	ctx, stop := signal.NotifyContext(context.Background(), syscall.SIGTERM, syscall.SIGINT)
	defer stop()
	return saveSnapshot(ctx, c, *name, *dir)
}

func saveSnapshot(ctx context.Context, c *config, name, dir string) error {
	cfg, err := c.etcdClientConfig()
	if err != nil {
		return fmt.Errorf("is this a running server? %w", err)
	}
	if err := os.MkdirAll(dir, 0o700); err != nil {
		return err
	}
	path := filepath.Join(dir, fmt.Sprintf("%s-%s-%d", name, c.NodeName, time.Now().Unix()))
	ctx, cancel := context.WithTimeout(ctx, 2*time.Minute)
	defer cancel()
	if _, err := snapshot.NewV3(zap.NewNop()).Save(ctx, cfg, path); err != nil {
		return fmt.Errorf("failed to save the snapshot: %w", err)
	}
	if err := os.Chmod(path, 0o600); err != nil {
		return err
	}
	logf("info", "Snapshot %s saved.", path)
	return nil
}

// clusterReset is `k3s server --cluster-reset`: it leaves a cluster of this
// one server with a snapshot's data, and ends. The data that was there is kept
// beside it.
func clusterReset(c *config) error {
	path := strings.TrimPrefix(c.resetRestore, "file://")
	if !exists(path) {
		return fmt.Errorf("etcd: snapshot path does not exist: %s", path)
	}
	restored := c.etcdDir() + "-restore"
	if err := os.RemoveAll(restored); err != nil {
		return err
	}
	err := snapshot.NewV3(zap.NewNop()).Restore(snapshot.RestoreConfig{
		SnapshotPath: path, Name: c.NodeName, OutputDataDir: restored,
		PeerURLs: []string{c.etcdPeer()}, InitialCluster: c.NodeName + "=" + c.etcdPeer(), InitialClusterToken: "etcd-cluster",
		// Watchers that saw later revisions must notice that time went back.
		RevisionBump: 1_000_000, MarkCompacted: true,
	})
	if err != nil {
		return fmt.Errorf("restoring %s: %w", path, err)
	}
	aside := fmt.Sprintf("%s-old-%d", c.etcdDir(), time.Now().Unix())
	if err := os.Rename(c.etcdDir(), aside); err != nil && !errors.Is(err, os.ErrNotExist) {
		return err
	}
	if err := os.Rename(restored, c.etcdDir()); err != nil {
		return err
	}
	logf("info", "Managed etcd cluster membership has been reset, restart without --cluster-reset flag now. "+
		"Backup and delete %s on each peer etcd server and rejoin the nodes", c.dataDir.server("db"))
	return nil
}
