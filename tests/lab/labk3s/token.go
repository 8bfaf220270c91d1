package main

import (
	"crypto/rand"
	"crypto/sha256"
	"crypto/subtle"
	"encoding/hex"
	"fmt"
	"regexp"
	"strings"

	bootstraputil "k8s.io/cluster-bootstrap/token/util"
)

// token is what a node joins with. k3s writes it as
// K10<sha256 of the CA bundle>::<user>:<secret>, or as the secret alone. A
// bootstrap token has no user: K10<hash>::<id>.<secret>, or <id>.<secret>.
type token struct {
	caHash string // empty in the short form: the CA is then trusted unseen
	user   string // empty of a bootstrap token
	secret string
}

const tokenPrefix = "K10"

// bootstrap says whether it is kubeadm's form, which ends and can be deleted.
func (t token) bootstrap() bool { return t.user == "" && t.secret != "" }

var hexHash = regexp.MustCompile(`^[0-9a-f]{64}$`)

// parseToken reads both forms; user names the one who joins with a short one.
func parseToken(value, user string) (token, error) {
	value = strings.TrimSpace(value)
	if value == "" {
		return token{}, fmt.Errorf("token must not be empty")
	}
	t := token{user: user}
	credentials := value
	if strings.HasPrefix(value, tokenPrefix) {
		hash, rest, ok := strings.Cut(strings.TrimPrefix(value, tokenPrefix), "::")
		if !ok || !hexHash.MatchString(hash) {
			return token{}, fmt.Errorf("invalid token format: K10<64 hexadecimal digits>::<user>:<secret> is wanted")
		}
		t.caHash, credentials = hash, rest
	}
	if bootstraputil.IsValidBootstrapToken(credentials) {
		t.user, t.secret = "", credentials
		return t, nil
	}
	if t.caHash == "" {
		t.secret = credentials
		return t, nil
	}
	name, secret, ok := strings.Cut(credentials, ":")
	if !ok || name == "" || secret == "" {
		return token{}, fmt.Errorf("invalid token format: no <user>:<secret> after the hash")
	}
	t.user, t.secret = name, secret
	return t, nil
}

// String is the full form, as the files under /var/lib/rancher/k3s/server hold it.
func (t token) String() string {
	if t.bootstrap() {
		return tokenPrefix + t.caHash + "::" + t.secret
	}
	return tokenPrefix + t.caHash + "::" + t.user + ":" + t.secret
}

// verifyCA refuses a server whose CA is not the one the token was made for.
func (t token) verifyCA(bundle []byte) error {
	if got := hashCA(bundle); t.caHash != "" && subtle.ConstantTimeCompare([]byte(got), []byte(t.caHash)) != 1 {
		return fmt.Errorf("token CA hash does not match the Cluster CA certificate hash: %s != %s", t.caHash, got)
	}
	return nil
}

func hashCA(bundle []byte) string {
	sum := sha256.Sum256(bundle)
	return hex.EncodeToString(sum[:])
}

// randomHex makes secrets of n bytes.
func randomHex(n int) string {
	raw := make([]byte, n)
	rand.Read(raw) // never fails: it ends the program instead
	return hex.EncodeToString(raw)
}

func same(a, b string) bool {
	x, y := sha256.Sum256([]byte(a)), sha256.Sum256([]byte(b))
	return subtle.ConstantTimeCompare(x[:], y[:]) == 1
}
