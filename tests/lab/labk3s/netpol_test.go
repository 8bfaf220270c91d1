package main

import (
	"context"
	"encoding/json"
	"net/http/httptest"
	"os"
	"path/filepath"
	"strings"
	"testing"
	"time"

	corev1 "k8s.io/api/core/v1"
	networkingv1 "k8s.io/api/networking/v1"
	metav1 "k8s.io/apimachinery/pkg/apis/meta/v1"
	"k8s.io/apimachinery/pkg/util/intstr"
	"k8s.io/client-go/kubernetes/fake"
)

// standInTools are in a host's place: they keep what they are to restore.
func standInTools(t *testing.T) (restored func(tool string) string) {
	t.Helper()
	directory := t.TempDir()
	keep := `/bin/cat > "$0.new" && /bin/mv "$0.new" "$0.restored"`
	for name, script := range map[string]string{
		"iptables":         `case "$*" in *--version*) echo "iptables v1.8.9 (nf_tables)";; *" -C "*) exit 1;; esac`,
		"iptables-save":    `echo "*filter"; echo COMMIT`,
		"iptables-restore": keep,
		"ipset":            `if [ "$1" = restore ]; then ` + keep + `; fi`,
	} {
		if err := os.WriteFile(filepath.Join(directory, name), []byte("#!/bin/sh\n"+script+"\n"), 0o700); err != nil {
			t.Fatal(err)
		}
	}
	t.Setenv("PATH", directory) // never the real ones
	return func(tool string) string {
		content, _ := os.ReadFile(filepath.Join(directory, tool+".restored"))
		return string(content)
	}
}

func runningPod(namespace, name, host, address string) *corev1.Pod {
	metrics := corev1.ContainerPort{Name: "metrics", ContainerPort: 9100, Protocol: corev1.ProtocolTCP}
	return &corev1.Pod{
		ObjectMeta: metav1.ObjectMeta{Namespace: namespace, Name: name},
		Spec:       corev1.PodSpec{Containers: []corev1.Container{{Ports: []corev1.ContainerPort{metrics}}}},
		Status: corev1.PodStatus{
			Phase: corev1.PodRunning, HostIP: host, PodIP: address, PodIPs: []corev1.PodIP{{IP: address}},
		},
	}
}

func namespace(name string) *corev1.Namespace {
	return &corev1.Namespace{ObjectMeta: metav1.ObjectMeta{Name: name, Labels: map[string]string{corev1.LabelMetadataName: name}}}
}

func TestNetworkPolicies(t *testing.T) {
	restored := standInTools(t)
	t.Setenv("NODE_NAME", "another")
	tcp, metrics := corev1.ProtocolTCP, intstr.FromString("metrics")
	watching := &metav1.LabelSelector{MatchLabels: map[string]string{corev1.LabelMetadataName: "observability"}}
	kube := fake.NewClientset(
		node("another", "10.42.1.0/24", "192.0.2.2"),
		node("this", "10.42.0.0/24", "192.0.2.1"),
		namespace("robot-1"), namespace("robot-2"), namespace("observability"),
		runningPod("robot-1", "guarded", "192.0.2.1", "10.42.0.5"),
		runningPod("robot-1", "sibling", "192.0.2.2", "10.42.1.5"),
		runningPod("robot-2", "stranger", "192.0.2.2", "10.42.1.6"),
		runningPod("observability", "scraper", "192.0.2.2", "10.42.1.7"),
		&networkingv1.NetworkPolicy{
			ObjectMeta: metav1.ObjectMeta{Namespace: "robot-1", Name: "within"},
			Spec: networkingv1.NetworkPolicySpec{
				PolicyTypes: []networkingv1.PolicyType{networkingv1.PolicyTypeIngress},
				Ingress: []networkingv1.NetworkPolicyIngressRule{
					{From: []networkingv1.NetworkPolicyPeer{{PodSelector: &metav1.LabelSelector{}}}},
					{
						From:  []networkingv1.NetworkPolicyPeer{{NamespaceSelector: watching}},
						Ports: []networkingv1.NetworkPolicyPort{{Protocol: &tcp, Port: &metrics}},
					},
				},
			},
		},
	)
	ctx, cancel := context.WithCancel(context.Background())
	ended := make(chan struct{})
	go func() {
		runNetworkPolicies(ctx, &config{NodeName: "this"}, kube)
		close(ended)
	}()
	t.Cleanup(func() {
		cancel()
		<-ended
	})
	if err := poll(ctx, 10*time.Millisecond, 30*time.Second, func() (bool, error) {
		return restored("iptables-restore") != "", nil
	}); err != nil {
		t.Fatal(err)
	}
	rules, sets := restored("iptables-restore"), restored("ipset")
	for text, wanted := range map[string]bool{
		"-d 10.42.0.5 -j KUBE-POD-FW-":                 true, // of this node, and so its rules are here
		"-d 10.42.1.5 -j KUBE-POD-FW-":                 false,
		"REJECT traffic destined for POD name:guarded": true,
		"--src-type LOCAL -d 10.42.0.5 -j ACCEPT":      true,
		"--dport 9100": true,
	} {
		if strings.Contains(rules, text) != wanted {
			t.Errorf("%q in the rules is not %v:\n%s", text, wanted, rules)
		}
	}
	for address, wanted := range map[string]bool{"10.42.1.5": true, "10.42.1.7": true, "10.42.1.6": false} {
		if strings.Contains(sets, " "+address+" ") != wanted {
			t.Errorf("%s among the sources is not %v:\n%s", address, wanted, sets)
		}
	}
}

func TestAgentsAreToldWhatTheServerIsTold(t *testing.T) {
	for _, disabled := range []bool{true, false} {
		answer := httptest.NewRecorder()
		(&supervisor{config: &config{DisableNetworkPolicy: disabled}}).serveConfig(answer, nil)
		told := clusterConfig{DisableNPC: !disabled}
		if err := json.Unmarshal(answer.Body.Bytes(), &told); err != nil || told.DisableNPC != disabled {
			t.Errorf("%v: told %q, %v", disabled, answer.Body, err)
		}
	}
}
