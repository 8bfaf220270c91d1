package main

import (
	"errors"
	"net"

	"github.com/vishvananda/netlink"
)

// defaultIP is the address of the interface that has the default route, as
// k3s chooses it; a host without one takes its first other address.
func defaultIP() (string, error) {
	routes, err := netlink.RouteList(nil, netlink.FAMILY_V4)
	if err != nil {
		return "", err
	}
	for _, route := range routes {
		if route.Dst != nil && !route.Dst.IP.IsUnspecified() {
			continue
		}
		if link, err := netlink.LinkByIndex(route.LinkIndex); err == nil {
			if ip := linkIP(link); ip != "" {
				return ip, nil
			}
		}
	}
	links, err := netlink.LinkList()
	if err != nil {
		return "", err
	}
	for _, link := range links {
		if link.Type() != "bridge" && link.Attrs().Flags&net.FlagLoopback == 0 {
			if ip := linkIP(link); ip != "" {
				return ip, nil
			}
		}
	}
	return "", errors.New("no address found for this node; give node-ip")
}

func linkIP(link netlink.Link) string {
	addrs, err := netlink.AddrList(link, netlink.FAMILY_V4)
	if err != nil {
		return ""
	}
	for _, addr := range addrs {
		if addr.IP.IsGlobalUnicast() {
			return addr.IP.String()
		}
	}
	return ""
}

// addressAt is the n-th address of a network.
func addressAt(network *net.IPNet, n byte) string {
	ip := append(net.IP{}, network.IP.To4()...)
	if ip == nil {
		ip = append(net.IP{}, network.IP...)
	}
	ip[len(ip)-1] += n
	return ip.String()
}
