package main

import (
	"context"
	"os"
	"path/filepath"
	"strings"
	"testing"
)

func TestCertificatesAreMadeAnewByTheNextStart(t *testing.T) {
	c := &config{dataDir: dataDir(t.TempDir()), NodeName: "edge1", NodeIP: "127.0.0.1"}
	start := func() map[string]string {
		t.Helper()
		cas, err := ensureCAs(c.dataDir)
		if err == nil {
			err = serverLeaves(c, cas)
		}
		if err != nil {
			t.Fatal(err)
		}
		found := map[string]string{}
		for _, name := range []string{"client-admin.key", "etcd/client.crt", "serving-kube-apiserver.key", "server-ca.crt", "service.key"} {
			content, err := os.ReadFile(c.dataDir.tls(name))
			if err != nil {
				t.Fatal(err)
			}
			found[name] = string(content)
		}
		return found
	}
	before := start()
	if err := certificateCommand(c.dataDir, []string{"rotate"}); err != nil {
		t.Fatal(err)
	}
	if exists(c.dataDir.tls("client-admin.crt")) || !exists(c.dataDir.tls("server-ca.key")) {
		t.Error("what went is not what was to go")
	}
	if copies, _ := filepath.Glob(c.dataDir.server("tls-*", "client-admin.key")); len(copies) != 1 {
		t.Errorf("copies: %v", copies)
	}
	for name, content := range start() {
		stays := strings.Contains(name, "-ca.") || name == "service.key"
		if (content == before[name]) != stays {
			t.Errorf("%s: the same as before: %v", name, content == before[name])
		}
	}
	for _, bad := range [][]string{nil, {"check"}, {"rotate", "--service", "admin"}} {
		if err := certificateCommand(c.dataDir, bad); err == nil {
			t.Errorf("%v was done", bad)
		}
	}
}

func TestAnAgentWithoutCertificatesNeedsAToken(t *testing.T) {
	s := startSite(t)
	s.addNode()
	full := "K10" + hashCA(s.ca) + "::" + good
	s.bearers[good] = true
	if err := s.join(t, full, "robot2"); err != nil {
		t.Fatal(err)
	}
	s.bearers = map[string]bool{}
	agent := dataDir(strings.TrimSuffix(s.base, "/agent/client-kubelet"))
	if err := os.RemoveAll(agent.tls()); err != nil { // the site's, which has served its turn
		t.Fatal(err)
	}
	if err := certificateCommand(agent, []string{"rotate"}); err != nil {
		t.Fatal(err)
	}
	if copies, _ := filepath.Glob(agent.agent("tls-*", "client-kubelet.key")); len(copies) != 1 {
		t.Errorf("copies: %v", copies)
	}
	if err := s.join(t, full, "robot2"); !refused(err) {
		t.Errorf("without a certificate, by a token that has ended: %v", err)
	}
	s.bearers[good] = true
	if err := s.join(t, full, "robot2"); err != nil {
		t.Errorf("by a new one: %v", err)
	}
}

func TestAnotherTokenIsTheOnlyOneFromThenOn(t *testing.T) {
	c := &config{dataDir: dataDir(t.TempDir()), NodeName: "edge1", NodeIP: "127.0.0.1"}
	s := startSiteOf(t, c)
	old := token{hashCA(s.ca), "server", "servers-secret"}
	if _, err := writeFile(c.dataDir.server("token"), []byte(old.String()+"\n"), 0o600); err != nil {
		t.Fatal(err)
	}
	if err := rotateToken(c.dataDir, s.url, []string{"--new-token", "x"}); err == nil {
		t.Error("a token that is said was taken")
	}
	if err := rotateToken(c.dataDir, s.url, nil); err != nil {
		t.Fatal(err)
	}
	content, err := os.ReadFile(c.dataDir.server("token"))
	if err != nil {
		t.Fatal(err)
	}
	made, err := parseToken(string(content), "server")
	if err != nil || made.secret == old.secret || made.verifyCA(s.ca) != nil {
		t.Fatalf("made %+v: %v", made, err)
	}
	for given, ok := range map[token]bool{old: false, made: true} {
		j, err := newJoiner(context.Background(), s.url, given, nil)
		if err != nil {
			t.Fatal(err)
		}
		if _, err := j.get(context.Background(), "/v1-k3s/client-ca.crt"); (err == nil) != ok {
			t.Errorf("let in: %v, and was to be %v", err == nil, ok)
		}
	}
}
