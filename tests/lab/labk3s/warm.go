package main

import (
	"fmt"

	_ "github.com/coredns/coredns/core"
	"github.com/coredns/coredns/coremain"
	_ "github.com/coredns/coredns/plugin/cache"
	_ "github.com/coredns/coredns/plugin/errors"
	_ "github.com/coredns/coredns/plugin/forward"
	_ "github.com/coredns/coredns/plugin/health"
	_ "github.com/coredns/coredns/plugin/hosts"
	_ "github.com/coredns/coredns/plugin/kubernetes"
	_ "github.com/coredns/coredns/plugin/ready"
	_ "github.com/coredns/coredns/plugin/reload"
	"github.com/vishvananda/netlink"
	clientv3 "go.etcd.io/etcd/client/v3"
	"go.etcd.io/etcd/server/v3/embed"
	kubectl "k8s.io/kubectl/pkg/cmd"
	apiserver "k8s.io/kubernetes/cmd/kube-apiserver/app"
	cm "k8s.io/kubernetes/cmd/kube-controller-manager/app"
	proxy "k8s.io/kubernetes/cmd/kube-proxy/app"
	scheduler "k8s.io/kubernetes/cmd/kube-scheduler/app"
	kubelet "k8s.io/kubernetes/cmd/kubelet/app"
	internalapi "k8s.io/cri-client/pkg"
	"go.etcd.io/etcd/etcdutl/v3/snapshot"
)

func main() {
	fmt.Println(coremain.Run, netlink.RouteReplace, clientv3.New, embed.StartEtcd, kubectl.NewDefaultKubectlCommand, apiserver.NewAPIServerCommand, cm.NewControllerManagerCommand, proxy.NewProxyCommand, scheduler.NewSchedulerCommand, kubelet.NewKubeletCommand, internalapi.NewRemoteRuntimeService, snapshot.NewV3)
}
