// Command coredns is upstream's CoreDNS with the plugins that the lab's
// Corefile uses: the content of the image rancher/mirrored-coredns-coredns.
package main

import (
	"github.com/coredns/coredns/core/dnsserver"
	"github.com/coredns/coredns/coremain"

	_ "github.com/coredns/coredns/plugin/cache"
	_ "github.com/coredns/coredns/plugin/errors"
	_ "github.com/coredns/coredns/plugin/forward"
	_ "github.com/coredns/coredns/plugin/kubernetes"
	_ "github.com/coredns/coredns/plugin/loadbalance"
	_ "github.com/coredns/coredns/plugin/ready"
	_ "github.com/coredns/coredns/plugin/reload"
)

func init() {
	// Upstream's order, which is the order that a query takes.
	dnsserver.Directives = []string{
		"reload", "ready", "errors", "cache", "loadbalance", "kubernetes", "forward",
	}
}

func main() { coremain.Run() }
