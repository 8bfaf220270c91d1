package main

import (
	"context"
	"encoding/json"
	"fmt"
	"io"
	"net/http"
	"os"
	"path/filepath"
	"strings"
	"time"
)

// certificateCommand is `k3s certificate rotate`: while k3s stands still it
// keeps a copy of certificates and keys and takes them away, all but those of
// authorities and accounts. The next start makes others.
func certificateCommand(d dataDir, args []string) error {
	if strings.Join(args, " ") != "rotate" {
		return fmt.Errorf("labk3s lacks `k3s certificate %s` (it has rotate)", strings.Join(args, " "))
	}
	name, kept := fmt.Sprintf("tls-%d", time.Now().Unix()), d.agent
	if exists(d.tls()) {
		kept = d.server
	}
	for _, place := range []string{d.agent(), d.tls(), d.tls("etcd")} {
		found, err := filepath.Glob(filepath.Join(place, "*.???"))
		if err != nil {
			return err
		}
		for _, path := range found {
			base := filepath.Base(path)
			ours := strings.HasSuffix(base, ".crt") || strings.HasSuffix(base, ".key")
			if !ours || strings.Contains(base, "-ca.") || base == "service.key" {
				continue
			}
			content, err := os.ReadFile(path)
			if err != nil {
				return err
			}
			if _, err := writeFile(kept(name, base), content, 0o600); err != nil {
				return err
			}
			if err := os.Remove(path); err != nil {
				return err
			}
		}
	}
	logf("info", "Successfully backed up certificates to %s, please restart k3s server or agent to rotate certificates", kept(name))
	return nil
}

// rotateToken is `k3s token rotate` without a token on its command line: the
// server makes one itself.
func rotateToken(d dataDir, server string, args []string) error {
	if len(args) > 0 {
		return fmt.Errorf("labk3s lacks `k3s token rotate %s`: the new token is made here", strings.Join(args, " "))
	}
	content, err := os.ReadFile(d.server("token"))
	if err != nil {
		return err
	}
	t, err := parseToken(string(content), "server")
	if err != nil {
		return err
	}
	ctx, cancel := context.WithTimeout(context.Background(), time.Minute)
	defer cancel()
	j, err := newJoiner(ctx, server, t, nil)
	if err != nil {
		return err
	}
	if _, err := j.do(ctx, http.MethodPut, "/v1-k3s/token", []byte("{}"), nil); err != nil {
		return err
	}
	fmt.Println("Token rotated, restart k3s nodes with new token")
	return nil
}

// serveTokenRotation makes another token and writes it where k3s does.
func (s *supervisor) serveTokenRotation(w http.ResponseWriter, r *http.Request) {
	var asked map[string]string
	body, err := io.ReadAll(io.LimitReader(r.Body, 1<<16))
	if err == nil {
		err = json.Unmarshal(body, &asked)
	}
	if err != nil || asked["newToken"] != "" {
		http.Error(w, "labk3s lacks a new token that is said", http.StatusBadRequest)
		return
	}
	made := token{hashCA(s.cas["server-ca"].pem), "server", randomHex(16)}
	if _, err := writeFile(s.config.dataDir.server("token"), []byte(made.String()+"\n"), 0o600); err != nil {
		http.Error(w, err.Error(), http.StatusInternalServerError)
		return
	}
	s.rotated.Store(&made.secret)
}

// serversSecret is what servers join with: that of the start, or the last one
// that was made since.
func (s *supervisor) serversSecret() string {
	if made := s.rotated.Load(); made != nil {
		return *made
	}
	return s.serverToken
}
