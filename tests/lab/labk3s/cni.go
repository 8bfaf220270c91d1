package main

import (
	"encoding/json"
	"net"
)

// cniConfig is this node's pod network: a bridge with addresses out of the
// node's own range. The bridge plugin's masquerading is off: it would also
// hide pods from pods of other nodes, and ROS nodes must see who calls them.
func cniConfig(podCIDR string) ([]byte, error) {
	if _, _, err := net.ParseCIDR(podCIDR); err != nil {
		return nil, err
	}
	return json.MarshalIndent(map[string]any{
		"name": "cbr0", "cniVersion": "1.0.0",
		"plugins": []any{
			map[string]any{
				"type": "bridge", "bridge": "cni0",
				"isGateway": true, "isDefaultGateway": true, "forceAddress": true,
				"ipMasq": false, "hairpinMode": true,
				"ipam": map[string]any{
					"type":   "host-local",
					"ranges": []any{[]any{map[string]string{"subnet": podCIDR}}},
				},
			},
			map[string]any{"type": "portmap", "capabilities": map[string]bool{"portMappings": true}, "snat": true},
		},
	}, "", "  ")
}
