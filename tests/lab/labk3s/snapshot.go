package main

import (
	"context"
	"errors"
	"fmt"
	"os"
	"os/signal"
	"path/filepath"
	"sort"
	"strconv"
	"strings"
	"syscall"
	"text/tabwriter"
	"time"

	"go.etcd.io/etcd/etcdutl/v3/snapshot"
	"go.uber.org/zap"
)

// snapshotCommand is `k3s etcd-snapshot`. It talks to this host's etcd itself;
// k3s asks its own supervisor, with the same outcome.
func snapshotCommand(args []string) error {
	command := ""
	if len(args) > 0 && !strings.HasPrefix(args[0], "-") {
		command, args = args[0], args[1:]
	}
	// Its flags may be spelt with k3s's prefix or without; the positional
	// arguments are the names to delete.
	var flags, names []string
	for i := 0; i < len(args); i++ {
		arg := args[i]
		if !strings.HasPrefix(arg, "-") {
			names = append(names, arg)
			continue
		}
		name, value, hasValue := strings.Cut(strings.TrimLeft(arg, "-"), "=")
		switch name {
		case "name", "dir":
			name = "etcd-snapshot-" + name
		case "snapshot-retention":
			name = "etcd-snapshot-retention"
		case "output", "o":
			return fmt.Errorf("labk3s lacks the flag --%s of `k3s etcd-snapshot`", name)
		}
		if !hasValue {
			if i++; i >= len(args) {
				return fmt.Errorf("flag --%s needs a value", name)
			}
			value = args[i]
		}
		flags = append(flags, "--"+name+"="+value)
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
	switch command {
	case "save":
		return saveSnapshot(ctx, c)
	case "list", "ls", "l":
		return listSnapshots(c)
	case "delete":
		return deleteSnapshots(c, names)
	case "prune":
		return pruneSnapshots(c)
	}
	return fmt.Errorf("labk3s lacks `k3s etcd-snapshot %s` (it has save, list, delete, prune)", command)
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

type snapshotFile struct {
	name, path string
	size       int64
	created    time.Time
}

func snapshots(c *config) ([]snapshotFile, error) {
	entries, err := os.ReadDir(c.snapshotDir)
	if err != nil && !os.IsNotExist(err) {
		return nil, err
	}
	var files []snapshotFile
	for _, entry := range entries {
		info, err := entry.Info()
		if err != nil || !info.Mode().IsRegular() || strings.HasSuffix(entry.Name(), ".part") {
			continue
		}
		created := info.ModTime()
		if i := strings.LastIndex(entry.Name(), "-"); i >= 0 {
			if seconds, err := strconv.ParseInt(entry.Name()[i+1:], 10, 64); err == nil {
				created = time.Unix(seconds, 0)
			}
		}
		files = append(files, snapshotFile{entry.Name(), filepath.Join(c.snapshotDir, entry.Name()), info.Size(), created})
	}
	sort.Slice(files, func(i, j int) bool { return files[i].created.Before(files[j].created) })
	return files, nil
}

func listSnapshots(c *config) error {
	files, err := snapshots(c)
	if err != nil {
		return err
	}
	w := tabwriter.NewWriter(os.Stdout, 0, 0, 1, ' ', 0)
	fmt.Fprintln(w, "Name\tLocation\tSize\tCreated")
	for _, file := range files {
		fmt.Fprintf(w, "%s\tfile://%s\t%d\t%s\n", file.name, file.path, file.size, file.created.UTC().Format(time.RFC3339))
	}
	return w.Flush()
}

func deleteSnapshots(c *config, names []string) error {
	if len(names) == 0 {
		return errors.New("no snapshots given for removal")
	}
	files, err := snapshots(c)
	if err != nil {
		return err
	}
	byName := map[string]string{}
	for _, file := range files {
		byName[file.name] = file.path
	}
	for _, name := range names {
		path, ok := byName[name]
		if !ok {
			return fmt.Errorf("snapshot %s not found", name)
		}
		if err := os.Remove(path); err != nil {
			return err
		}
		logf("info", "Snapshot %s deleted.", name)
	}
	return nil
}

func pruneSnapshots(c *config) error {
	files, err := snapshots(c)
	if err != nil {
		return err
	}
	var same []snapshotFile
	for _, file := range files {
		if strings.HasPrefix(file.name, c.snapshotName+"-"+c.nodeName+"-") {
			same = append(same, file)
		}
	}
	for len(same) > c.snapshotKeep {
		if err := os.Remove(same[0].path); err != nil {
			return err
		}
		logf("info", "Snapshot %s deleted.", same[0].name)
		same = same[1:]
	}
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
