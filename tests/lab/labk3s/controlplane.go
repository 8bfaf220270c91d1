package main

import (
	"context"
	"time"

	"k8s.io/client-go/kubernetes"
)

func apiserverArgs(c *config) map[string]string {
	tls := c.dataDir.tls
	args := map[string]string{
		"advertise-address":                  c.NodeIP,
		"allow-privileged":                   "true",
		"anonymous-auth":                     "false",
		"api-audiences":                      "https://kubernetes.default.svc." + clusterDomain + ",k3s",
		"authorization-mode":                 "Node,RBAC",
		"bind-address":                       apiserverIP,
		"client-ca-file":                     tls("client-ca.crt"),
		"enable-admission-plugins":           "NodeRestriction",
		"enable-aggregator-routing":          "true",
		"enable-bootstrap-token-auth":        "true",
		"etcd-cafile":                        tls("etcd", "server-ca.crt"),
		"etcd-certfile":                      tls("etcd", "client.crt"),
		"etcd-keyfile":                       tls("etcd", "client.key"),
		"etcd-servers":                       etcdLocal,
		"kubelet-certificate-authority":      tls("server-ca.crt"),
		"kubelet-client-certificate":         tls("client-kube-apiserver.crt"),
		"kubelet-client-key":                 tls("client-kube-apiserver.key"),
		"kubelet-preferred-address-types":    "InternalIP,ExternalIP,Hostname",
		"permit-port-sharing":                "true",
		"profiling":                          "false",
		"proxy-client-cert-file":             tls("client-auth-proxy.crt"),
		"proxy-client-key-file":              tls("client-auth-proxy.key"),
		"requestheader-allowed-names":        "system:auth-proxy",
		"requestheader-client-ca-file":       tls("request-header-ca.crt"),
		"requestheader-extra-headers-prefix": "X-Remote-Extra-",
		"requestheader-group-headers":        "X-Remote-Group",
		"requestheader-username-headers":     "X-Remote-User",
		"secure-port":                        apiPort,
		"service-account-issuer":             "https://kubernetes.default.svc." + clusterDomain,
		"service-account-key-file":           tls("service.key"),
		"service-account-signing-key-file":   tls("service.key"),
		"service-cluster-ip-range":           serviceCIDR,
		"storage-backend":                    "etcd3",
		"tls-cert-file":                      tls("serving-kube-apiserver.crt"),
		"tls-private-key-file":               tls("serving-kube-apiserver.key"),
	}
	if c.SecretsEncryption {
		args["encryption-provider-config"] = c.encryptionFile()
		args["encryption-provider-config-automatic-reload"] = "true"
	}
	return args
}

func controllerArgs(c *config) map[string]string {
	tls := c.dataDir.tls
	kubeconfig := c.dataDir.server("cred", "controller.kubeconfig")
	args := map[string]string{
		"allocate-node-cidrs":              "true",
		"authentication-kubeconfig":        kubeconfig,
		"authorization-kubeconfig":         kubeconfig,
		"bind-address":                     "127.0.0.1",
		"cluster-cidr":                     clusterCIDR,
		"configure-cloud-routes":           "false",
		"controllers":                      "*,tokencleaner",
		"kubeconfig":                       kubeconfig,
		"leader-elect":                     "false", // there is no other server
		"profiling":                        "false",
		"root-ca-file":                     tls("server-ca.crt"),
		"service-account-private-key-file": tls("service.key"),
		"service-cluster-ip-range":         serviceCIDR,
		"use-service-account-credentials":  "true",
	}
	for signer, ca := range map[string]string{
		"kubelet-serving": "server-ca", "kubelet-client": "client-ca",
		"kube-apiserver-client": "client-ca", "legacy-unknown": "client-ca",
	} {
		args["cluster-signing-"+signer+"-cert-file"] = tls(ca + ".crt")
		args["cluster-signing-"+signer+"-key-file"] = tls(ca + ".key")
	}
	return args
}

func schedulerArgs(c *config) map[string]string {
	kubeconfig := c.dataDir.server("cred", "scheduler.kubeconfig")
	return map[string]string{
		"authentication-kubeconfig": kubeconfig,
		"authorization-kubeconfig":  kubeconfig,
		"bind-address":              "127.0.0.1",
		"kubeconfig":                kubeconfig,
		"leader-elect":              "false",
		"profiling":                 "false",
	}
}

// startControlPlane starts the API server and, once it is ready, the others.
func startControlPlane(ctx context.Context, c *config, procs *processes, kube kubernetes.Interface, ready func()) error {
	tls := c.dataDir.tls
	for name, base := range map[string]string{"controller": "client-controller", "scheduler": "client-scheduler"} {
		path := c.dataDir.server("cred", name+".kubeconfig")
		if err := writeKubeconfig(path, apiserverURL, tls("server-ca.crt"), tls(base), false, 0o600); err != nil {
			return err
		}
	}
	if err := waitFree(ctx, 10257, 10259); err != nil {
		return err
	}
	if err := procs.component("kube-apiserver", arguments(apiserverArgs(c), c.APIServerArgs...)); err != nil {
		return err
	}
	if err := waitReady(ctx, kube); err != nil {
		return err
	}
	ready()
	if err := procs.component("kube-controller-manager", arguments(controllerArgs(c), c.ControllerArgs...)); err != nil {
		return err
	}
	return procs.component("kube-scheduler", arguments(schedulerArgs(c)))
}

// waitReady asks the API server itself, past the supervisor.
func waitReady(ctx context.Context, kube kubernetes.Interface) error {
	return poll(ctx, 100*time.Millisecond, 0, func() (bool, error) {
		request := kube.Discovery().RESTClient().Get().AbsPath("/readyz").Timeout(5 * time.Second)
		_, err := request.MaxRetries(0).DoRaw(ctx) // its own retries come once a second
		return err == nil, nil
	})
}
