package main

import (
	"maps"
	"os"
	"path/filepath"
	"slices"
	"testing"

	corev1 "k8s.io/api/core/v1"
	metav1 "k8s.io/apimachinery/pkg/apis/meta/v1"
)

func node(name, podCIDR, address string) *corev1.Node {
	return &corev1.Node{
		ObjectMeta: metav1.ObjectMeta{Name: name},
		Spec:       corev1.NodeSpec{PodCIDR: podCIDR},
		Status:     corev1.NodeStatus{Addresses: []corev1.NodeAddress{{Type: corev1.NodeInternalIP, Address: address}}},
	}
}

func TestRoutes(t *testing.T) {
	nodes := []*corev1.Node{
		node("edge1", "10.42.0.0/24", "192.0.2.1"),
		node("robot1", "10.42.1.0/24", "192.0.2.2"),
		node("robot2", "", "192.0.2.3"),
		{ObjectMeta: metav1.ObjectMeta{Name: "robot3"}, Spec: corev1.NodeSpec{PodCIDR: "10.42.3.0/24"}},
	}
	got, want := wantedRoutes(nodes, "robot1"), map[string]string{"10.42.0.0/24": "192.0.2.1"}
	if !maps.Equal(got, want) {
		t.Errorf("got %v, want %v", got, want)
	}
}

func TestDatastore(t *testing.T) {
	alone := &config{dataDir: dataDir(t.TempDir())}
	if got := alone.etcdDir(); alone.managed() || filepath.Base(got) != "state.db" {
		t.Errorf("a server without cluster-init: %s", got)
	}
	wal := alone.etcdDir("member", "wal")
	if err := os.MkdirAll(wal, 0o700); err != nil {
		t.Fatal(err)
	}
	if err := alone.takeOver(); err != nil || !exists(wal) {
		t.Errorf("without cluster-init the data was taken over: %v", err)
	}
	several := &config{dataDir: alone.dataDir, ClusterInit: true}
	for range 2 { // a second start has nothing to take over
		if err := several.takeOver(); err != nil {
			t.Fatal(err)
		}
	}
	if !several.etcdInitialised() || exists(wal) || !exists(several.dataDir.server("db", "state.db.migrated", "member")) {
		t.Error("the data was not taken over, or is still in its old place")
	}
	if got := alone.etcdDir(); !alone.managed() || filepath.Base(got) != "etcd" {
		t.Errorf("without cluster-init again: %s", got)
	}
}

func TestAClientsCertificateIsKept(t *testing.T) {
	d := dataDir(t.TempDir())
	cas, err := ensureCAs(d)
	if err != nil {
		t.Fatal(err)
	}
	for _, server := range []bool{false, true} {
		base, wanted := d.tls("x"), leaf{name: "x", names: []string{"a", "192.0.2.1"}, client: !server, server: server}
		var issued [2]string
		for i := range issued {
			if err := cas["server-ca"].ensureLeaf(base, wanted); err != nil {
				t.Fatal(err)
			}
			content, err := os.ReadFile(base + ".crt")
			if err != nil {
				t.Fatal(err)
			}
			issued[i] = string(content)
		}
		if (issued[0] == issued[1]) == server {
			t.Errorf("server %v: the certificate was kept: %v", server, !server)
		}
	}
}

func TestListeningPorts(t *testing.T) {
	got := listeningPorts(`  sl  local_address rem_address   st tx_queue
   0: 0100007F:094B 00000000:0000 0A 00000000:00000000
   1: 0B4D4D0A:94CA 0B4D4D0A:192B 01 00000000:00000000
   2: 00000000:192B 00000000:0000 0A 00000000:00000000
`)
	if !slices.Equal(got, []int{2379, 6443}) {
		t.Errorf("got %v", got)
	}
}
