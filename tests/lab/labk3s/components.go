package main

import (
	"context"
	"os"

	_ "k8s.io/client-go/plugin/pkg/client/auth"
	"k8s.io/component-base/cli"
	"k8s.io/component-base/logs"
	_ "k8s.io/component-base/logs/json/register"
	_ "k8s.io/component-base/metrics/prometheus/clientgo"
	_ "k8s.io/component-base/metrics/prometheus/version"
	kubectl "k8s.io/kubectl/pkg/cmd"
	kubectlutil "k8s.io/kubectl/pkg/cmd/util"
	apiserver "k8s.io/kubernetes/cmd/kube-apiserver/app"
	controllers "k8s.io/kubernetes/cmd/kube-controller-manager/app"
	proxy "k8s.io/kubernetes/cmd/kube-proxy/app"
	scheduler "k8s.io/kubernetes/cmd/kube-scheduler/app"
	kubelet "k8s.io/kubernetes/cmd/kubelet/app"

	"github.com/spf13/cobra"
)

// components are the parts that labk3s starts itself as, one process each.
var components = map[string]func([]string) error{
	"kube-apiserver":          componentCommand(apiserver.NewAPIServerCommand),
	"kube-controller-manager": componentCommand(controllers.NewControllerManagerCommand),
	"kube-scheduler":          componentCommand(func() *cobra.Command { return scheduler.NewSchedulerCommand() }),
	"kube-proxy":              componentCommand(proxy.NewProxyCommand),
	"kubelet": componentCommand(func() *cobra.Command {
		return kubelet.NewKubeletCommand(context.Background())
	}),
}

func componentCommand(build func() *cobra.Command) func([]string) error {
	return func(args []string) error {
		command := build()
		// Some of them parse os.Args themselves.
		os.Args = append([]string{command.Name()}, args...)
		command.SetArgs(args)
		return exitCode(cli.Run(command))
	}
}

// kubectlCommand is kubectl; without any choice of a cluster it takes k3s's.
func kubectlCommand(args []string) error {
	os.Args = append([]string{"kubectl"}, args...)
	if os.Getenv("KUBECONFIG") == "" {
		// Without a kubeconfig k3s leaves kubectl's own default in place.
		if exists(kubeconfigFile) {
			os.Setenv("KUBECONFIG", kubeconfigFile)
		}
	}
	if _, err := logs.GlogSetter(kubectl.GetLogVerbosity(os.Args)); err != nil {
		return err
	}
	if err := cli.RunNoErrOutput(kubectl.NewDefaultKubectlCommand()); err != nil {
		kubectlutil.CheckErr(err) // prints and exits
	}
	return nil
}
