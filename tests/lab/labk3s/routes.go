package main

import (
	"context"
	"fmt"
	"net"
	"strings"
	"time"

	"github.com/vishvananda/netlink"
	corev1 "k8s.io/api/core/v1"
	"k8s.io/apimachinery/pkg/labels"
	"k8s.io/client-go/informers"
	"k8s.io/client-go/kubernetes"
	listers "k8s.io/client-go/listers/core/v1"
	"k8s.io/client-go/tools/cache"
	"k8s.io/kubernetes/pkg/util/iptables"
)

// routeProtocol marks our routes in the kernel, so that the stale ones can be
// told from everybody else's.
const routeProtocol = 0x6b

// runRoutes keeps the way to the other nodes' pods open: one route per node,
// as flannel's host-gw has it, and the masquerading of what leaves the cluster.
func runRoutes(ctx context.Context, c *config, kube kubernetes.Interface) {
	factory := informers.NewSharedInformerFactory(kube, 0)
	nodes := factory.Core().V1().Nodes()
	changed := make(chan struct{}, 1)
	poke := func() {
		select {
		case changed <- struct{}{}:
		default:
		}
	}
	if _, err := nodes.Informer().AddEventHandler(cache.ResourceEventHandlerFuncs{
		AddFunc: func(any) { poke() }, DeleteFunc: func(any) { poke() },
		UpdateFunc: func(before, after any) {
			// Heartbeats come all the time; routes follow from these alone.
			if a, b := before.(*corev1.Node), after.(*corev1.Node); a.Spec.PodCIDR != b.Spec.PodCIDR || nodeAddress(a) != nodeAddress(b) {
				poke()
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
	poke()
	// A link that goes down takes its routes along, and somebody's firewall
	// reload our rules; both come back here.
	tick := time.NewTicker(2 * time.Second)
	defer tick.Stop()
	n, said := 0, ""
	for {
		select {
		case <-ctx.Done():
			return
		case <-changed:
		case <-tick.C:
		}
		err := syncNetwork(c, nodes.Lister())
		if err == nil && n%15 == 0 {
			err = syncFirewall()
		}
		n++
		if text := fmt.Sprint(err); err != nil && text != said {
			logf("warning", "pod network: %v", err)
			said = text
		} else if err == nil {
			said = ""
		}
	}
}

func syncNetwork(c *config, lister listers.NodeLister) error {
	nodes, err := lister.List(labels.Everything())
	if err != nil {
		return err
	}
	for _, node := range nodes {
		if node.Name != c.NodeName || node.Spec.PodCIDR == "" {
			continue
		}
		content, err := cniConfig(node.Spec.PodCIDR)
		if err != nil {
			return err
		}
		changed, err := writeFile(c.dataDir.agent("etc", "cni", "net.d", "10-labk3s.conflist"), content, 0o644)
		if err != nil {
			return err
		}
		if changed {
			logf("info", "Pod network of this node is %s", node.Spec.PodCIDR)
		}
	}
	return applyRoutes(wantedRoutes(nodes, c.NodeName))
}

// wantedRoutes says, per network of pods on another node, the way there.
func wantedRoutes(nodes []*corev1.Node, self string) map[string]string {
	routes := map[string]string{}
	for _, node := range nodes {
		if address := nodeAddress(node); node.Name != self && node.Spec.PodCIDR != "" && address != "" {
			routes[node.Spec.PodCIDR] = address
		}
	}
	return routes
}

func nodeAddress(node *corev1.Node) string {
	for _, address := range node.Status.Addresses {
		if address.Type == corev1.NodeInternalIP {
			return address.Address
		}
	}
	return ""
}

func applyRoutes(wanted map[string]string) error {
	_, pods, err := net.ParseCIDR(clusterCIDR)
	if err != nil {
		return err
	}
	present, err := netlink.RouteListFiltered(netlink.FAMILY_V4, &netlink.Route{Protocol: routeProtocol}, netlink.RT_FILTER_PROTOCOL)
	if err != nil {
		return err
	}
	for _, route := range present {
		if route.Dst == nil || !pods.Contains(route.Dst.IP) {
			continue
		}
		if wanted[route.Dst.String()] == route.Gw.String() {
			delete(wanted, route.Dst.String())
			continue
		}
		logf("info", "Removing route %s via %s", route.Dst, route.Gw)
		if err := netlink.RouteDel(&route); err != nil {
			return err
		}
	}
	for network, gateway := range wanted {
		_, dst, err := net.ParseCIDR(network)
		if err != nil {
			return err
		}
		err = netlink.RouteReplace(&netlink.Route{Dst: dst, Gw: net.ParseIP(gateway), Protocol: routeProtocol})
		if err != nil {
			return fmt.Errorf("route to %s via %s (nodes must share a network): %w", network, gateway, err)
		}
		logf("info", "Added route %s via %s", network, gateway)
	}
	return nil
}

// Our iptables chains; README.md lists them for those who clean up.
const (
	natChain     = "LABK3S-POSTROUTING"
	forwardChain = "LABK3S-FORWARD"
)

// syncFirewall hides pods from the outside only, and lets their traffic pass
// on hosts that forward nothing by default.
func syncFirewall() error {
	tables := iptables.New(iptables.ProtocolIPv4)
	for _, r := range []struct {
		table       iptables.Table
		chain, from iptables.Chain
		match       string
	}{
		{iptables.TableNAT, natChain, iptables.ChainPostrouting, "-s " + clusterCIDR + " -d " + clusterCIDR + " -j RETURN"},
		{iptables.TableNAT, natChain, iptables.ChainPostrouting, "-s " + clusterCIDR + " ! -d 224.0.0.0/4 -j MASQUERADE"},
		{iptables.TableFilter, forwardChain, iptables.ChainForward, "-s " + clusterCIDR + " -j ACCEPT"},
		{iptables.TableFilter, forwardChain, iptables.ChainForward, "-d " + clusterCIDR + " -j ACCEPT"},
	} {
		if _, err := tables.EnsureChain(r.table, r.chain); err != nil {
			return err
		}
		if _, err := tables.EnsureRule(iptables.Append, r.table, r.chain, strings.Fields(r.match)...); err != nil {
			return err
		}
		position := iptables.Prepend
		if r.table == iptables.TableFilter {
			// Behind what refuses by a NetworkPolicy, as flannel's chain is.
			position = iptables.Append
		}
		if _, err := tables.EnsureRule(position, r.table, r.from, "-j", string(r.chain)); err != nil {
			return err
		}
	}
	return nil
}
