package main

import (
	"context"
	"fmt"
	"os"
	"sync"
	"time"

	"github.com/cloudnativelabs/kube-router/v2/pkg/controllers/netpol"
	"github.com/cloudnativelabs/kube-router/v2/pkg/healthcheck"
	"github.com/cloudnativelabs/kube-router/v2/pkg/options"
	"k8s.io/client-go/informers"
	"k8s.io/client-go/kubernetes"
)

// runNetworkPolicies enforces the cluster's NetworkPolicies on this node's
// pods, by the controller of kube-router that k3s has a fork of.
func runNetworkPolicies(ctx context.Context, c *config, kube kubernetes.Interface) {
	factory := informers.NewSharedInformerFactory(kube, 0)
	var controller *netpol.NetworkPolicyController
	said := ""
	err := poll(ctx, time.Second, 0, func() (bool, error) {
		var err error
		controller, err = newPolicyController(c, kube, factory)
		if text := fmt.Sprint(err); err != nil && text != said {
			logf("warning", "Waiting to enforce network policies: %s", text)
			said = text
		}
		return err == nil, err
	})
	if err != nil {
		return // asked to stop
	}
	// Nobody asks how it is, but it waits until it could say so.
	beats := make(chan *healthcheck.ControllerHeartbeat)
	defer close(beats)
	go func() {
		for range beats {
		}
	}()
	// It takes what it does not know for allowed, so it begins when it has heard of everything.
	factory.Start(ctx.Done())
	factory.WaitForCacheSync(ctx.Done())
	logf("info", "Network policies are enforced")
	var running sync.WaitGroup
	running.Add(1)
	controller.Run(beats, ctx.Done(), &running)
	running.Wait()
}

func newPolicyController(c *config, kube kubernetes.Interface, factory informers.SharedInformerFactory) (*netpol.NetworkPolicyController, error) {
	// Without this the name of the host is believed to be the node's.
	if err := os.Setenv("NODE_NAME", c.NodeName); err != nil {
		return nil, err
	}
	wanted := options.NewKubeRouterConfig()
	wanted.ClusterIPCIDRs = []string{serviceCIDR}
	wanted.EnableIPv4 = true
	tables, sets, err := netpol.NewIPTablesHandlers(wanted)
	if err != nil {
		return nil, err
	}
	pods := factory.Core().V1().Pods().Informer()
	namespaces := factory.Core().V1().Namespaces().Informer()
	policies := factory.Networking().V1().NetworkPolicies().Informer()
	controller, err := netpol.NewNetworkPolicyController(kube, wanted, pods, policies, namespaces, &sync.Mutex{}, tables, sets)
	if err != nil {
		return nil, err
	}
	if _, err := pods.AddEventHandler(controller.PodEventHandler); err != nil {
		return nil, err
	}
	if _, err := namespaces.AddEventHandler(controller.NamespaceEventHandler); err != nil {
		return nil, err
	}
	_, err = policies.AddEventHandler(controller.NetworkPolicyEventHandler)
	return controller, err
}
