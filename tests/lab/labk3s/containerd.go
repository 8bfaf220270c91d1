package main

import (
	"context"
	"fmt"
	"os"
	"os/exec"
	"path/filepath"
	"time"

	"google.golang.org/grpc"
	"google.golang.org/grpc/credentials/insecure"
	cri "k8s.io/cri-api/pkg/apis/runtime/v1"
)

// startContainerd runs the host's containerd with a configuration of ours and
// brings in the images that lie ready. Containers belong to their shims, which
// outlive containerd and us: a restart of the service restarts no pod.
func startContainerd(ctx context.Context, c *config, procs *processes, images string) error {
	program, err := exec.LookPath("containerd")
	if err != nil {
		return err
	}
	if registries := filepath.Join(etcDir, "registries.yaml"); exists(registries) {
		return fmt.Errorf("labk3s lacks registries (%s)", registries)
	}
	path := c.dataDir.agent("etc", "containerd", "config.toml")
	if _, err := writeFile(path, []byte(containerdConfig(c)), 0o600); err != nil {
		return err
	}
	logFile := c.dataDir.agent("containerd", "containerd.log")
	for _, dir := range []string{filepath.Dir(logFile), images, c.dataDir.agent("etc", "cni", "net.d"), containerdState} {
		if err := os.MkdirAll(dir, 0o755); err != nil {
			return err
		}
	}
	if err := procs.program(logFile, program, "--config", path); err != nil {
		return err
	}
	if err := waitContainerd(ctx); err != nil {
		return fmt.Errorf("containerd is not ready (its log is %s): %w", logFile, err)
	}
	importImages(ctx, images)
	return nil
}

func containerdConfig(c *config) string {
	return fmt.Sprintf(`version = 2
root = %q
state = %q
disabled_plugins = ["io.containerd.snapshotter.v1.aufs", "io.containerd.snapshotter.v1.btrfs", "io.containerd.snapshotter.v1.devmapper", "io.containerd.snapshotter.v1.zfs"]

[grpc]
  address = %q

[plugins."io.containerd.grpc.v1.cri"]
  sandbox_image = "rancher/mirrored-pause:3.6"
  enable_selinux = false
  restrict_oom_score_adj = true
  disable_hugetlb_controller = true
  tolerate_missing_hugetlb_controller = true

[plugins."io.containerd.grpc.v1.cri".containerd]
  snapshotter = "overlayfs"
  disable_snapshot_annotations = true

[plugins."io.containerd.grpc.v1.cri".containerd.runtimes.runc]
  runtime_type = "io.containerd.runc.v2"

[plugins."io.containerd.grpc.v1.cri".containerd.runtimes.runc.options]
  SystemdCgroup = false

[plugins."io.containerd.grpc.v1.cri".cni]
  bin_dir = %q
  conf_dir = %q
`, c.dataDir.agent("containerd"), containerdState, containerdSocket,
		cniBinDir, c.dataDir.agent("etc", "cni", "net.d"))
}

func dialCRI() (*grpc.ClientConn, error) {
	return grpc.NewClient("unix://"+containerdSocket, grpc.WithTransportCredentials(insecure.NewCredentials()),
		grpc.WithDefaultCallOptions(grpc.MaxCallRecvMsgSize(16<<20)))
}

// waitContainerd waits for the runtime service, not just for the socket.
func waitContainerd(ctx context.Context) error {
	return poll(ctx, 100*time.Millisecond, time.Minute, func() (bool, error) {
		conn, err := dialCRI()
		if err != nil {
			return false, err
		}
		defer conn.Close()
		call, cancel := context.WithTimeout(ctx, time.Second)
		defer cancel()
		_, err = cri.NewRuntimeServiceClient(conn).Version(call, &cri.VersionRequest{})
		return err == nil, err
	})
}
