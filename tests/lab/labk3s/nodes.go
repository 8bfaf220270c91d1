package main

import (
	"context"
	"fmt"
	"time"

	corev1 "k8s.io/api/core/v1"
	apierrors "k8s.io/apimachinery/pkg/api/errors"
	metav1 "k8s.io/apimachinery/pkg/apis/meta/v1"
	"k8s.io/apimachinery/pkg/labels"
	"k8s.io/apimachinery/pkg/types"
	"k8s.io/client-go/informers"
	"k8s.io/client-go/kubernetes"
	"k8s.io/client-go/tools/cache"
)

// runNodeController keeps what follows from the list of nodes: the role of
// this server's own node and, when a node is deleted, the end of its password.
func runNodeController(ctx context.Context, c *config, kube kubernetes.Interface) {
	factory := informers.NewSharedInformerFactory(kube, 0)
	nodes := factory.Core().V1().Nodes()
	gone := make(chan *corev1.Node, 64)
	if _, err := nodes.Informer().AddEventHandler(cache.ResourceEventHandlerFuncs{
		DeleteFunc: func(object any) {
			if unknown, ok := object.(cache.DeletedFinalStateUnknown); ok {
				object = unknown.Obj
			}
			if node, ok := object.(*corev1.Node); ok {
				gone <- node
			}
		},
	}); err != nil {
		logf("error", "watching nodes: %v", err)
		return
	}
	factory.Start(ctx.Done())
	if !cache.WaitForCacheSync(ctx.Done(), nodes.Informer().HasSynced) {
		return
	}
	tick := time.NewTicker(time.Second)
	defer tick.Stop()
	said := ""
	for {
		var err error
		select {
		case <-ctx.Done():
			return
		case node := <-gone:
			err = forgetNode(ctx, node.Name, kube)
		case <-tick.C:
			all, listErr := nodes.Lister().List(labels.Everything())
			err = listErr
			for _, node := range all {
				if err == nil && node.Name == c.NodeName {
					err = markServer(ctx, node, kube)
				}
			}
		}
		if err != nil && ctx.Err() == nil && err.Error() != said {
			said = err.Error()
			logf("warning", "nodes: %v", err)
		}
	}
}

// markServer gives this server's node its role.
func markServer(ctx context.Context, node *corev1.Node, kube kubernetes.Interface) error {
	const role = "node-role.kubernetes.io/control-plane"
	if node.Labels[role] == "true" {
		return nil
	}
	patch := fmt.Sprintf(`{"metadata":{"labels":{%q:"true"}}}`, role)
	_, err := kube.CoreV1().Nodes().Patch(ctx, node.Name, types.MergePatchType, []byte(patch), metav1.PatchOptions{})
	return err
}

// forgetNode lets a host of the same name, but perhaps with a new disk, come again.
func forgetNode(ctx context.Context, node string, kube kubernetes.Interface) error {
	err := kube.CoreV1().Secrets(metav1.NamespaceSystem).Delete(ctx, nodePasswordSecret(node), metav1.DeleteOptions{})
	if apierrors.IsNotFound(err) {
		return nil
	}
	return err
}
