package main

import (
	"context"
	"errors"
	"fmt"
	"maps"
	"os"
	"os/exec"
	"path/filepath"
	"slices"
	"strings"
	"time"
)

// imageFile is what tells an archive from its later version.
type imageFile struct {
	size, modified int64
}

// imageImporter keeps the archives under agent/images in containerd.
type imageImporter struct {
	dir  string
	seen map[string]imageFile // what this run has dealt with
}

// start imports what lies there at a start. A broken archive costs its own
// images, not the node.
func (i *imageImporter) start(ctx context.Context) {
	i.seen = listImages(i.dir)
	for _, name := range slices.Sorted(maps.Keys(i.seen)) {
		importImage(ctx, filepath.Join(i.dir, name))
	}
}

// watch imports what is put there later, once it has stopped growing.
func (i *imageImporter) watch(ctx context.Context) {
	growing := map[string]imageFile{}
	_ = poll(ctx, time.Second, 0, func() (bool, error) {
		now := listImages(i.dir)
		for name, file := range now {
			switch {
			case i.seen[name] == file:
			case growing[name] != file:
				growing[name] = file
			default:
				delete(growing, name)
				i.seen[name] = file
				importImage(ctx, filepath.Join(i.dir, name))
			}
		}
		maps.DeleteFunc(i.seen, func(name string, _ imageFile) bool {
			_, there := now[name]
			return !there
		})
		return false, nil
	})
}

func listImages(dir string) map[string]imageFile {
	files := map[string]imageFile{}
	entries, err := os.ReadDir(dir)
	if err != nil {
		return files
	}
	for _, entry := range entries {
		if strings.HasPrefix(entry.Name(), ".") {
			continue
		}
		// Through links, too: archives are large and often lie elsewhere.
		if info, err := os.Stat(filepath.Join(dir, entry.Name())); err == nil && info.Mode().IsRegular() {
			files[entry.Name()] = imageFile{info.Size(), info.ModTime().UnixNano()}
		}
	}
	return files
}

func importImage(ctx context.Context, path string) {
	start := time.Now()
	if err := importArchive(ctx, path); err != nil {
		logf("error", "Failed to import images from %s: %v", path, err)
		return
	}
	logf("info", "Imported images from %s in %s", path, time.Since(start).Round(10*time.Millisecond))
}

// importArchive streams an archive into containerd through the host's ctr.
func importArchive(ctx context.Context, path string) error {
	if filepath.Ext(path) != ".tar" {
		return errors.New("labk3s imports .tar alone")
	}
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
