package main

// kind says how an option takes its value.
type kind int

const (
	text kind = iota
	flag      // a boolean
	list      // repeatable
)

// Which of the two long-running commands know an option.
const (
	onServer = 1 << iota
	onAgent
	onBoth = onServer | onAgent
)

// option is one flag of k3s, which is at the same time a key of config.yaml.
// Those that are not listed here are refused.
type option struct {
	name  string
	short string
	kind  kind
	on    int
	env   string
	comma bool // k3s also splits this one's values at commas
	// only lists the values that labk3s can serve; empty means any.
	only []string
}

var options = buildOptions()

func buildOptions() map[string]*option {
	all := []*option{
		{name: "config", short: "c", on: onBoth, env: "K3S_CONFIG_FILE"},
		{name: "debug", kind: flag, on: onBoth, env: "K3S_DEBUG"},
		{name: "v", on: onBoth},
		{name: "data-dir", short: "d", on: onBoth, env: "K3S_DATA_DIR"},
		{name: "token", short: "t", on: onBoth, env: "K3S_TOKEN"},
		{name: "token-file", on: onBoth, env: "K3S_TOKEN_FILE"},
		{name: "server", short: "s", on: onBoth, env: "K3S_URL"},
		{name: "node-name", on: onBoth, env: "K3S_NODE_NAME"},
		{name: "node-label", kind: list, on: onBoth},
		{name: "node-taint", kind: list, on: onBoth},
		{name: "node-ip", short: "i", kind: list, comma: true, on: onBoth},
		{name: "kubelet-arg", kind: list, on: onBoth},
		{name: "kube-proxy-arg", kind: list, on: onBoth},
		{name: "pause-image", on: onBoth},
		{name: "resolv-conf", on: onBoth, env: "K3S_RESOLV_CONF"},
		{name: "snapshotter", on: onBoth, only: []string{"overlayfs", "native"}},
		{name: "protect-kernel-defaults", kind: flag, on: onBoth},
		{name: "lb-server-port", on: onBoth, env: "K3S_LB_SERVER_PORT"},
		{name: "selinux", kind: flag, on: onBoth, env: "K3S_SELINUX", only: []string{"false"}},

		{name: "agent-token", on: onServer, env: "K3S_AGENT_TOKEN"},
		{name: "agent-token-file", on: onServer, env: "K3S_AGENT_TOKEN_FILE"},
		{name: "cluster-init", kind: flag, on: onServer, env: "K3S_CLUSTER_INIT"},
		{name: "cluster-reset", kind: flag, on: onServer, env: "K3S_CLUSTER_RESET"},
		{name: "cluster-reset-restore-path", on: onServer},
		{name: "advertise-address", on: onServer},
		{name: "tls-san", kind: list, comma: true, on: onServer},
		// Certificates here never take names from requests, which is what
		// this option turns on.
		{name: "tls-san-security", kind: flag, on: onServer, only: []string{"true"}},
		{name: "cluster-cidr", kind: list, comma: true, on: onServer},
		{name: "service-cidr", kind: list, comma: true, on: onServer},
		{name: "service-node-port-range", on: onServer},
		{name: "cluster-dns", kind: list, comma: true, on: onServer},
		{name: "cluster-domain", on: onServer},
		// What runs here is what k3s calls host-gw.
		{name: "flannel-backend", on: onServer, only: []string{"host-gw"}},
		{name: "write-kubeconfig", short: "o", on: onServer, env: "K3S_KUBECONFIG_OUTPUT"},
		{name: "write-kubeconfig-mode", on: onServer, env: "K3S_KUBECONFIG_MODE"},
		{name: "kube-apiserver-arg", kind: list, on: onServer},
		{name: "kube-controller-manager-arg", kind: list, on: onServer},
		{name: "kube-scheduler-arg", kind: list, on: onServer},
		{name: "default-local-storage-path", on: onServer},
		// Nothing of these exists here.
		{name: "disable", kind: list, comma: true, on: onServer,
			only: []string{"servicelb", "traefik", "metrics-server", "runtimes"}},
		{name: "disable-kube-proxy", kind: flag, on: onServer},
		// Nothing of these three exists here, so "true" is always so.
		{name: "disable-cloud-controller", kind: flag, on: onServer, only: []string{"true"}},
		{name: "disable-network-policy", kind: flag, on: onServer, only: []string{"true"}},
		{name: "disable-helm-controller", kind: flag, on: onServer, only: []string{"true"}},
		// No snapshot is ever taken on a schedule here.
		{name: "etcd-disable-snapshots", kind: flag, on: onServer, only: []string{"true"}},
		{name: "etcd-snapshot-dir", on: onServer},
		{name: "etcd-snapshot-name", on: onServer},
	}
	byName := make(map[string]*option, len(all))
	for _, o := range all {
		byName[o.name] = o
	}
	return byName
}
