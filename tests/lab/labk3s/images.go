package main

import (
	"bufio"
	"compress/bzip2"
	"compress/gzip"
	"context"
	"encoding/json"
	"errors"
	"fmt"
	"io"
	"os"
	"os/exec"
	"path/filepath"
	"sort"
	"strings"
	"time"

	"github.com/klauspost/compress/zstd"
	cri "k8s.io/cri-api/pkg/apis/runtime/v1"
)

// imageFile is what tells an archive from its later version.
type imageFile struct {
	Size    int64     `json:"size"`
	ModTime time.Time `json:"modTime"`
}

func (f imageFile) same(other imageFile) bool {
	return f.Size == other.Size && f.ModTime.Equal(other.ModTime)
}

// cacheName is k3s's switch: with that file in the images' directory an
// archive is imported once, without it at every start.
const cacheName = ".cache.json"

// imageImporter keeps the archives under agent/images in containerd.
type imageImporter struct {
	dir  string
	seen map[string]imageFile // what this run has dealt with
}

// start imports what lies there at a start. A broken archive costs its own
// images, not the node.
func (i *imageImporter) start(ctx context.Context) {
	dir := i.dir
	cache, cached := loadImageCache(dir)
	i.seen = listImages(dir)
	for _, name := range sortedKeys(i.seen) {
		file := i.seen[name]
		if cached && cache[name].same(file) {
			continue
		}
		if importImage(ctx, dir, name) {
			cache[name] = file
		}
	}
	if cached {
		saveImageCache(dir, cache)
	}
}

// watch imports what is put there later, once it has stopped growing.
func (i *imageImporter) watch(ctx context.Context) {
	dir, done, growing := i.dir, i.seen, map[string]imageFile{}
	_ = poll(ctx, time.Second, 0, func() (bool, error) {
		now := listImages(dir)
		for name, file := range now {
			switch {
			case done[name].same(file):
			case !growing[name].same(file):
				growing[name] = file
			default:
				delete(growing, name)
				done[name] = file
				if !importImage(ctx, dir, name) {
					continue
				}
				if cache, cached := loadImageCache(dir); cached {
					cache[name] = file
					saveImageCache(dir, cache)
				}
			}
		}
		for name := range done {
			if _, ok := now[name]; !ok {
				delete(done, name)
			}
		}
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
			files[entry.Name()] = imageFile{info.Size(), info.ModTime()}
		}
	}
	return files
}

func loadImageCache(dir string) (map[string]imageFile, bool) {
	cache := map[string]imageFile{}
	content, err := os.ReadFile(filepath.Join(dir, cacheName))
	if err != nil {
		return cache, false
	}
	// Switched on by `touch`, it starts out empty.
	_ = json.Unmarshal(content, &cache)
	return cache, true
}

func saveImageCache(dir string, cache map[string]imageFile) {
	for name := range cache {
		if !exists(filepath.Join(dir, name)) {
			delete(cache, name)
		}
	}
	content, err := json.Marshal(cache)
	if err == nil {
		_, err = writeFile(filepath.Join(dir, cacheName), content, 0o644)
	}
	if err != nil {
		logf("warning", "writing %s: %v", cacheName, err)
	}
}

func importImage(ctx context.Context, dir, name string) bool {
	start := time.Now()
	path := filepath.Join(dir, name)
	var err error
	if strings.HasSuffix(name, ".txt") {
		err = pullList(ctx, path)
	} else {
		err = importArchive(ctx, path)
	}
	if err != nil {
		logf("error", "Failed to import images from %s: %v", path, err)
		return false
	}
	logf("info", "Imported images from %s in %s", path, time.Since(start).Round(10*time.Millisecond))
	return true
}

// importArchive streams an archive into containerd through the host's ctr.
func importArchive(ctx context.Context, path string) error {
	file, err := os.Open(path)
	if err != nil {
		return err
	}
	defer file.Close()
	reader, err := decompress(file, filepath.Base(path))
	if err != nil {
		return err
	}
	command := exec.CommandContext(ctx, "ctr", "--address", containerdSocket, "--namespace", "k8s.io", "images", "import", "-")
	command.Env = childEnv()
	command.Stdin = reader
	output, err := command.CombinedOutput()
	if err != nil {
		return fmt.Errorf("%w: %s", err, strings.TrimSpace(string(output)))
	}
	return nil
}

func decompress(file io.Reader, name string) (io.Reader, error) {
	switch {
	case strings.HasSuffix(name, ".tar"):
		return file, nil
	case strings.HasSuffix(name, ".tar.gz"), strings.HasSuffix(name, ".tgz"):
		return gzip.NewReader(file)
	case strings.HasSuffix(name, ".tar.zst"), strings.HasSuffix(name, ".tzst"):
		decoder, err := zstd.NewReader(file)
		if err != nil {
			return nil, err
		}
		return decoder.IOReadCloser(), nil
	case strings.HasSuffix(name, ".tar.bz2"), strings.HasSuffix(name, ".tbz"):
		return bzip2.NewReader(file), nil
	case strings.HasSuffix(name, ".tar.lz4"):
		return nil, errors.New("labk3s lacks lz4")
	}
	return nil, errors.New("not an archive of images (.tar, .tar.gz, .tar.zst, .tar.bz2) nor a list of them (.txt)")
}

// pullList pulls the images that a text file names, one a line.
func pullList(ctx context.Context, path string) error {
	file, err := os.Open(path)
	if err != nil {
		return err
	}
	defer file.Close()
	conn, err := dialCRI()
	if err != nil {
		return err
	}
	defer conn.Close()
	var failed []string
	for lines := bufio.NewScanner(file); lines.Scan(); {
		image := strings.TrimSpace(lines.Text())
		if image == "" || strings.HasPrefix(image, "#") {
			continue
		}
		call, cancel := context.WithTimeout(ctx, 5*time.Minute)
		_, err := cri.NewImageServiceClient(conn).PullImage(call, &cri.PullImageRequest{Image: &cri.ImageSpec{Image: image}})
		cancel()
		if err != nil {
			failed = append(failed, fmt.Sprintf("%s: %v", image, err))
		}
	}
	sort.Strings(failed)
	if len(failed) > 0 {
		return errors.New(strings.Join(failed, "; "))
	}
	return nil
}
