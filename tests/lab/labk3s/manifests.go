package main

import (
	"bytes"
	"context"
	"crypto/sha256"
	"embed"
	"errors"
	"fmt"
	"io"
	"io/fs"
	"os"
	"path/filepath"
	"sort"
	"strings"
	"time"

	"k8s.io/apimachinery/pkg/api/meta"
	metav1 "k8s.io/apimachinery/pkg/apis/meta/v1"
	"k8s.io/apimachinery/pkg/apis/meta/v1/unstructured"
	"k8s.io/apimachinery/pkg/runtime"
	"k8s.io/apimachinery/pkg/util/yaml"
	"k8s.io/client-go/discovery/cached/memory"
	"k8s.io/client-go/dynamic"
	"k8s.io/client-go/kubernetes"
	"k8s.io/client-go/restmapper"
)

//go:embed manifests/*.yaml
var packaged embed.FS

// deployer applies what lies in server/manifests, and applies it again when
// it changes. As with k3s, taking a file away deletes nothing.
type deployer struct {
	config  *config
	dir     string
	client  dynamic.Interface
	mapper  *restmapper.DeferredDiscoveryRESTMapper
	applied map[string][sha256.Size]byte
	said    map[string]string
}

func newDeployer(c *config, kube kubernetes.Interface, client dynamic.Interface) *deployer {
	return &deployer{
		config: c, dir: c.dataDir.server("manifests"), client: client,
		mapper:  restmapper.NewDeferredDiscoveryRESTMapper(memory.NewMemCacheClient(kube.Discovery())),
		applied: map[string][sha256.Size]byte{}, said: map[string]string{},
	}
}

func (d *deployer) run(ctx context.Context) {
	if err := d.writePackaged(); err != nil {
		logf("error", "writing the packaged manifests: %v", err)
	}
	_ = poll(ctx, time.Second, 0, func() (bool, error) {
		for _, path := range d.files() {
			d.applyFile(ctx, path)
		}
		return false, nil
	})
}

// packagedManifest fills this cluster's values into a packaged manifest.
func packagedManifest(c *config, name string) ([]byte, error) {
	content, err := packaged.ReadFile("manifests/" + name)
	if err != nil {
		return nil, err
	}
	for variable, value := range map[string]string{
		"%{CLUSTER_DNS}%": c.clusterDNS, "%{CLUSTER_DOMAIN}%": c.clusterDomain,
	} {
		content = bytes.ReplaceAll(content, []byte(variable), []byte(value))
	}
	return content, nil
}

// writePackaged puts our own manifests where k3s puts its own.
func (d *deployer) writePackaged() error {
	entries, err := packaged.ReadDir("manifests")
	if err != nil {
		return err
	}
	for _, entry := range entries {
		content, err := packagedManifest(d.config, entry.Name())
		if err != nil {
			return err
		}
		if _, err := writeFile(filepath.Join(d.dir, entry.Name()), content, 0o600); err != nil {
			return err
		}
	}
	return nil
}

func (d *deployer) files() []string {
	var files []string
	// A directory that cannot be read has no manifests; that it should have
	// shows in the log of who writes there.
	_ = filepath.WalkDir(d.dir, func(path string, entry fs.DirEntry, err error) error {
		if err != nil || entry.IsDir() {
			return nil
		}
		name := entry.Name()
		switch filepath.Ext(name) {
		case ".yaml", ".yml", ".json":
			if !strings.HasPrefix(name, ".") && !exists(path+".skip") {
				files = append(files, path)
			}
		}
		return nil
	})
	sort.Strings(files)
	return files
}

func (d *deployer) applyFile(ctx context.Context, path string) {
	content, err := os.ReadFile(path)
	if err != nil {
		return // gone since
	}
	sum := sha256.Sum256(content)
	if d.applied[path] == sum {
		return
	}
	if err := d.applyAll(ctx, content); err != nil {
		// Tried again each second: a kind may be defined by another file.
		if d.said[path] != err.Error() && ctx.Err() == nil {
			d.said[path] = err.Error()
			logf("error", "Failed to apply %s: %v", path, err)
		}
		return
	}
	d.applied[path] = sum
	delete(d.said, path)
	logf("info", "Applied manifest at %q", path)
}

func (d *deployer) applyAll(ctx context.Context, content []byte) error {
	objects, err := decodeObjects(content)
	if err != nil {
		return err
	}
	var failed []error
	for _, object := range objects {
		resource, err := d.resource(object)
		if err == nil {
			_, err = resource.Apply(ctx, object.GetName(), object, metav1.ApplyOptions{FieldManager: "deploy@labk3s", Force: true})
		}
		if err != nil {
			failed = append(failed, fmt.Errorf("%s %s: %w", object.GetKind(), object.GetName(), err))
		}
	}
	return errors.Join(failed...)
}

func (d *deployer) resource(object *unstructured.Unstructured) (dynamic.ResourceInterface, error) {
	kind := object.GroupVersionKind()
	mapping, err := d.mapper.RESTMapping(kind.GroupKind(), kind.Version)
	if meta.IsNoMatchError(err) {
		d.mapper.Reset()
		mapping, err = d.mapper.RESTMapping(kind.GroupKind(), kind.Version)
	}
	if err != nil {
		return nil, err
	}
	if mapping.Scope.Name() != meta.RESTScopeNameNamespace {
		return d.client.Resource(mapping.Resource), nil
	}
	namespace := object.GetNamespace()
	if namespace == "" {
		namespace = metav1.NamespaceDefault
	}
	return d.client.Resource(mapping.Resource).Namespace(namespace), nil
}

func decodeObjects(content []byte) ([]*unstructured.Unstructured, error) {
	var objects []*unstructured.Unstructured
	decoder := yaml.NewYAMLOrJSONDecoder(bytes.NewReader(content), 4096)
	for {
		object := &unstructured.Unstructured{}
		err := decoder.Decode(object)
		if errors.Is(err, io.EOF) {
			return objects, nil
		}
		if err != nil {
			return nil, err
		}
		switch {
		case len(object.Object) == 0:
		case object.IsList():
			err := object.EachListItem(func(item runtime.Object) error {
				objects = append(objects, item.(*unstructured.Unstructured))
				return nil
			})
			if err != nil {
				return nil, err
			}
		default:
			objects = append(objects, object)
		}
	}
}
