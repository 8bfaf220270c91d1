package main

import (
	"context"
	"fmt"
	"os"
	"os/exec"
	"path/filepath"
	"strings"
	"time"
)

// importImages brings the archives that lie in a directory into containerd, at
// every start. A broken one costs its own images, not the node.
func importImages(ctx context.Context, dir string) {
	found, _ := filepath.Glob(filepath.Join(dir, "*.tar")) // the pattern is a good one
	for _, path := range found {
		start := time.Now()
		if err := importArchive(ctx, path); err != nil {
			logf("error", "Failed to import images from %s: %v", path, err)
			continue
		}
		logf("info", "Imported images from %s in %s", path, time.Since(start).Round(10*time.Millisecond))
	}
}

// importArchive streams an archive into containerd through the host's ctr.
func importArchive(ctx context.Context, path string) error {
	file, err := os.Open(path)
	if err != nil {
		return err
	}
	defer file.Close()
	command := exec.CommandContext(ctx, "ctr", "--address", containerdSocket, "--namespace", "k8s.io", "images", "import", "-")
	command.Env = childEnv()
	command.Stdin = file
	output, err := command.CombinedOutput()
	if err != nil {
		return fmt.Errorf("%w: %s", err, strings.TrimSpace(string(output)))
	}
	return nil
}
