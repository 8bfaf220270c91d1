package main

import (
	"context"
	"fmt"
	"os"
	"path/filepath"
	"slices"
	"strings"
	"time"

	corev1 "k8s.io/api/core/v1"
	apierrors "k8s.io/apimachinery/pkg/api/errors"
	metav1 "k8s.io/apimachinery/pkg/apis/meta/v1"
	"k8s.io/apimachinery/pkg/labels"
	"k8s.io/client-go/informers"
	"k8s.io/client-go/kubernetes"
	"k8s.io/client-go/tools/cache"
)

const (
	provisionerName      = "rancher.io/local-path"
	selectedNode         = "volume.kubernetes.io/selected-node"
	provisionedBy        = "pv.kubernetes.io/provisioned-by"
	provisioningInterval = 500 * time.Millisecond
)

// runProvisioner is the server's half of local-path volumes: it answers each
// claim, once the scheduler has chosen a node for it, with a volume on that
// node. Several servers may do so at once: the volume's name follows from the
// claim, so they agree.
func runProvisioner(ctx context.Context, c *config, kube kubernetes.Interface) {
	factory := informers.NewSharedInformerFactory(kube, 0)
	claims, classes := factory.Core().V1().PersistentVolumeClaims(), factory.Storage().V1().StorageClasses()
	synced := []cache.InformerSynced{claims.Informer().HasSynced, classes.Informer().HasSynced}
	factory.Start(ctx.Done())
	if !cache.WaitForCacheSync(ctx.Done(), synced...) {
		return
	}
	said := map[string]string{} // one line per claim and trouble
	_ = poll(ctx, provisioningInterval, 0, func() (bool, error) {
		all, err := claims.Lister().List(labels.Everything())
		if err != nil {
			return false, err
		}
		for _, claim := range all {
			if claim.Status.Phase != corev1.ClaimPending || claim.Spec.VolumeName != "" || claim.Spec.StorageClassName == nil {
				continue
			}
			class, err := classes.Lister().Get(*claim.Spec.StorageClassName)
			if err != nil || class.Provisioner != provisionerName {
				continue
			}
			volume, err := volumeFor(claim, class.Name, c.dataDir.storage())
			if volume == nil && err == nil {
				continue // no node chosen yet
			}
			if err == nil {
				_, err = kube.CoreV1().PersistentVolumes().Create(ctx, volume, metav1.CreateOptions{})
			}
			switch {
			case err == nil:
				logf("info", "Provisioned volume %s", volume.Name)
			case apierrors.IsAlreadyExists(err) || ctx.Err() != nil:
			case said[string(claim.UID)] != err.Error():
				said[string(claim.UID)] = err.Error()
				logf("error", "provisioning a volume for the claim %s/%s: %v", claim.Namespace, claim.Name, err)
			}
		}
		return false, nil
	})
}

// volumeFor is the volume that a claim gets, nil while it has to wait.
func volumeFor(claim *corev1.PersistentVolumeClaim, class, storage string) (*corev1.PersistentVolume, error) {
	node := claim.Annotations[selectedNode]
	if node == "" {
		return nil, nil
	}
	for _, mode := range claim.Spec.AccessModes {
		if !slices.Contains([]corev1.PersistentVolumeAccessMode{corev1.ReadWriteOnce, corev1.ReadWriteOncePod}, mode) {
			return nil, fmt.Errorf("NodePath only supports ReadWriteOnce and ReadWriteOncePod (1.22+) access modes")
		}
	}
	name := "pvc-" + string(claim.UID)
	create := corev1.HostPathDirectoryOrCreate
	return &corev1.PersistentVolume{
		ObjectMeta: metav1.ObjectMeta{
			Name: name,
			Annotations: map[string]string{
				provisionedBy:                          provisionerName,
				"local.path.provisioner/selected-node": node,
			},
		},
		Spec: corev1.PersistentVolumeSpec{
			PersistentVolumeReclaimPolicy: corev1.PersistentVolumeReclaimDelete,
			StorageClassName:              class,
			AccessModes:                   claim.Spec.AccessModes,
			Capacity:                      corev1.ResourceList{corev1.ResourceStorage: claim.Spec.Resources.Requests[corev1.ResourceStorage]},
			ClaimRef: &corev1.ObjectReference{
				Kind: "PersistentVolumeClaim", APIVersion: "v1", Namespace: claim.Namespace, Name: claim.Name,
				UID: claim.UID, ResourceVersion: claim.ResourceVersion,
			},
			PersistentVolumeSource: corev1.PersistentVolumeSource{HostPath: &corev1.HostPathVolumeSource{
				Path: filepath.Join(storage, name+"_"+claim.Namespace+"_"+claim.Name),
				Type: &create,
			}},
			NodeAffinity: &corev1.VolumeNodeAffinity{Required: &corev1.NodeSelector{
				NodeSelectorTerms: []corev1.NodeSelectorTerm{{MatchExpressions: []corev1.NodeSelectorRequirement{{
					Key: corev1.LabelHostname, Operator: corev1.NodeSelectorOpIn, Values: []string{node},
				}}}},
			}},
		},
	}, nil
}

// runVolumes is the node's half: it makes the directory that a volume of this
// node needs, open to any user as local-path's are, and removes directory and
// volume once the claim is gone.
func runVolumes(ctx context.Context, c *config, kube kubernetes.Interface) {
	factory := informers.NewSharedInformerFactory(kube, 0)
	volumes := factory.Core().V1().PersistentVolumes()
	synced := volumes.Informer().HasSynced
	factory.Start(ctx.Done())
	if !cache.WaitForCacheSync(ctx.Done(), synced) {
		return
	}
	_ = poll(ctx, provisioningInterval, 0, func() (bool, error) {
		all, err := volumes.Lister().List(labels.Everything())
		if err != nil {
			return false, err
		}
		for _, volume := range all {
			if volumeNode(volume) != c.NodeName || volume.DeletionTimestamp != nil {
				continue
			}
			if err := tendVolume(ctx, volume, c.dataDir.storage(), kube); err != nil && ctx.Err() == nil {
				logf("warning", "volume %s: %v", volume.Name, err)
			}
		}
		return false, nil
	})
}

// volumeNode is the node of a volume of our provisioner, "" for all others.
func volumeNode(volume *corev1.PersistentVolume) string {
	if volume.Annotations[provisionedBy] != provisionerName {
		return ""
	}
	return volume.Annotations["local.path.provisioner/selected-node"]
}

func tendVolume(ctx context.Context, volume *corev1.PersistentVolume, storage string, kube kubernetes.Interface) error {
	if volume.Spec.HostPath == nil {
		return nil
	}
	path := filepath.Clean(volume.Spec.HostPath.Path)
	if !strings.HasPrefix(path, filepath.Clean(storage)+"/") {
		return fmt.Errorf("%s is not below %s", path, storage)
	}
	switch volume.Status.Phase {
	case corev1.VolumeReleased:
		if err := os.RemoveAll(path); err != nil {
			return err
		}
		logf("info", "Removed volume %s and its directory %s", volume.Name, path)
		err := kube.CoreV1().PersistentVolumes().Delete(ctx, volume.Name, metav1.DeleteOptions{})
		if apierrors.IsNotFound(err) {
			return nil
		}
		return err
	case corev1.VolumeFailed:
		return nil
	}
	info, err := os.Stat(path)
	switch {
	case os.IsNotExist(err):
		if err := os.MkdirAll(path, 0o777); err != nil {
			return err
		}
		return os.Chmod(path, 0o777) // past the umask
	case err != nil:
		return err
	case info.Mode().Perm() != 0o777 && time.Since(volume.CreationTimestamp.Time) < time.Minute:
		return os.Chmod(path, 0o777) // the kubelet was first
	}
	return nil
}
