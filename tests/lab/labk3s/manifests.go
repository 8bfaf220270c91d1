package main

import (
	"bytes"
	"context"
	"embed"
	"os/exec"
	"time"
)

//go:embed manifests/*.yaml
var packaged embed.FS

// applyPackaged applies what k3s has in server/manifests, at each start of a
// server and by its own kubectl. As with k3s, nothing is ever deleted.
func applyPackaged(ctx context.Context, c *config) {
	var all [][]byte
	entries, err := packaged.ReadDir("manifests")
	for _, entry := range entries {
		var content []byte
		if content, err = packaged.ReadFile("manifests/" + entry.Name()); err == nil {
			all = append(all, content)
		}
	}
	if err != nil {
		logf("error", "reading the packaged manifests: %v", err)
		return
	}
	_ = poll(ctx, time.Second, 0, func() (bool, error) {
		command := exec.CommandContext(ctx, "/proc/self/exe", "kubectl", "apply", "--server-side", "--force-conflicts",
			"--field-manager=deploy@labk3s", "--validate=false", "--cache-dir", c.dataDir.server("cache"), "-f", "-")
		command.Env = append(childEnv(), "KUBECONFIG="+kubeconfigFile)
		command.Stdin = bytes.NewReader(bytes.Join(all, []byte("---\n")))
		output, err := command.CombinedOutput()
		if err != nil && ctx.Err() == nil {
			logf("error", "Failed to apply the packaged manifests: %v: %s", err, output)
		}
		return err == nil, err
	})
}
