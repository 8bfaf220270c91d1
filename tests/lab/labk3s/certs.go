package main

import (
	"bytes"
	"crypto"
	"crypto/rand"
	"crypto/x509"
	"crypto/x509/pkix"
	"encoding/pem"
	"fmt"
	"net"
	"os"
	"time"

	certutil "k8s.io/client-go/util/cert"
	"k8s.io/client-go/util/keyutil"
)

const (
	leafLife = 365 * 24 * time.Hour
	// Lab hosts share a clock, real ones need not: a certificate made a moment
	// ago must not be "not yet valid" on a host that is a little behind.
	clockSlack = time.Hour
)

// caNames are the CA files under server/tls.
var caNames = []string{"server-ca", "client-ca", "request-header-ca", "etcd/server-ca", "etcd/peer-ca"}

type authority struct {
	cert *x509.Certificate
	key  crypto.Signer
	pem  []byte
}

// ensureCAs makes the authorities and the service account key that are not
// there yet, and loads all of them.
func ensureCAs(d dataDir) (map[string]*authority, error) {
	cas := map[string]*authority{}
	for _, name := range caNames {
		crt, key := d.tls(name+".crt"), d.tls(name+".key")
		if !exists(crt) {
			if err := newCA(crt, key, name); err != nil {
				return nil, err
			}
		}
		ca, err := loadCA(crt, key)
		if err != nil {
			return nil, err
		}
		cas[name] = ca
	}
	if path := d.tls("service.key"); !exists(path) {
		if _, err := newKey(path); err != nil {
			return nil, err
		}
	}
	return cas, nil
}

func newCA(crtPath, keyPath, name string) error {
	key, err := newKey(keyPath)
	if err != nil {
		return err
	}
	now := time.Now()
	ca, err := certutil.NewSelfSignedCACert(certutil.Config{
		CommonName: fmt.Sprintf("k3s-%s@%d", name, now.Unix()), NotBefore: now.Add(-clockSlack),
	}, key)
	if err != nil {
		return err
	}
	_, err = writeFile(crtPath, certPEM(ca.Raw), 0o644)
	return err
}

func loadCA(crtPath, keyPath string) (*authority, error) {
	content, err := os.ReadFile(crtPath)
	if err != nil {
		return nil, err
	}
	cert, err := parseCert(content)
	if err != nil {
		return nil, fmt.Errorf("%s: %w", crtPath, err)
	}
	key, err := loadKey(keyPath)
	if err != nil {
		return nil, err
	}
	return &authority{cert: cert, key: key, pem: content}, nil
}

// leaf describes a certificate that an authority signs.
type leaf struct {
	name   string
	groups []string
	names  []string // DNS names and addresses
	client bool
	server bool
}

func (l leaf) template() *x509.Certificate {
	now := time.Now()
	t := &x509.Certificate{
		Subject:   pkix.Name{CommonName: l.name, Organization: l.groups},
		NotBefore: now.Add(-clockSlack),
		NotAfter:  now.Add(leafLife),
		KeyUsage:  x509.KeyUsageDigitalSignature | x509.KeyUsageKeyEncipherment,
	}
	if l.client {
		t.ExtKeyUsage = append(t.ExtKeyUsage, x509.ExtKeyUsageClientAuth)
	}
	if l.server {
		t.ExtKeyUsage = append(t.ExtKeyUsage, x509.ExtKeyUsageServerAuth)
	}
	for _, name := range l.names {
		if ip := net.ParseIP(name); ip != nil {
			t.IPAddresses = append(t.IPAddresses, ip)
		} else if name != "" {
			t.DNSNames = append(t.DNSNames, name)
		}
	}
	return t
}

// sign issues a certificate for a public key.
func (a *authority) sign(l leaf, public crypto.PublicKey) ([]byte, error) {
	der, err := x509.CreateCertificate(rand.Reader, l.template(), a.cert, public, a.key)
	if err != nil {
		return nil, err
	}
	return certPEM(der), nil
}

// ensureLeaf makes the certificate at base+".crt". A client's stays as it is:
// k3s.yaml holds one. A server's is made anew at each start: names may change.
func (a *authority) ensureLeaf(base string, l leaf) error {
	if content, err := os.ReadFile(base + ".crt"); err == nil && !l.server && bytes.HasSuffix(content, a.pem) {
		return nil
	}
	key, err := newKey(base + ".key")
	if err != nil {
		return err
	}
	cert, err := a.sign(l, key.Public())
	if err != nil {
		return err
	}
	_, err = writeFile(base+".crt", append(cert, a.pem...), 0o644)
	return err
}

func newKey(path string) (crypto.Signer, error) {
	content, err := keyutil.MakeEllipticPrivateKeyPEM()
	if err != nil {
		return nil, err
	}
	if _, err := writeFile(path, content, 0o600); err != nil {
		return nil, err
	}
	return loadKey(path)
}

func loadKey(path string) (crypto.Signer, error) {
	key, err := keyutil.PrivateKeyFromFile(path)
	if err != nil {
		return nil, err
	}
	return key.(crypto.Signer), nil
}

// newCSR keeps the key at base+".key" on this host; only the request leaves it.
func newCSR(base string) ([]byte, error) {
	key, err := loadKey(base + ".key")
	if err != nil {
		if key, err = newKey(base + ".key"); err != nil {
			return nil, err
		}
	}
	return certutil.MakeCSR(key, &pkix.Name{}, nil, nil)
}

func parseCSR(content []byte) (crypto.PublicKey, error) {
	block, _ := pem.Decode(content)
	if block == nil {
		return nil, fmt.Errorf("no certificate request")
	}
	request, err := x509.ParseCertificateRequest(block.Bytes)
	if err != nil {
		return nil, err
	}
	return request.PublicKey, request.CheckSignature()
}

func parseCert(content []byte) (*x509.Certificate, error) {
	certs, err := certutil.ParseCertsPEM(content)
	if err != nil {
		return nil, err
	}
	return certs[0], nil
}

func certPEM(der []byte) []byte {
	return pem.EncodeToMemory(&pem.Block{Type: "CERTIFICATE", Bytes: der})
}

// serverLeaves are the certificates of one server, all but the node's own.
func serverLeaves(c *config, cas map[string]*authority) error {
	hostname, err := os.Hostname()
	if err != nil {
		return err
	}
	apiNames := append([]string{
		"kubernetes", "kubernetes.default", "kubernetes.default.svc", "kubernetes.default.svc." + clusterDomain,
		"localhost", "127.0.0.1", "::1", apiserverIP, serviceAPI, c.NodeName, hostname, c.NodeIP,
	}, c.TLSSANs...)
	etcdNames := []string{"localhost", "127.0.0.1", "::1", hostname, c.NodeIP}
	for _, wanted := range []struct {
		ca, base string
		leaf     leaf
	}{
		{"server-ca", "serving-kube-apiserver", leaf{name: "kube-apiserver", names: apiNames, server: true}},
		{"client-ca", "client-admin", leaf{name: "system:admin", groups: []string{"system:masters"}, client: true}},
		{"client-ca", "client-supervisor", leaf{name: "system:k3s-supervisor", groups: []string{"system:masters"}, client: true}},
		{"client-ca", "client-controller", leaf{name: "system:kube-controller-manager", client: true}},
		{"client-ca", "client-scheduler", leaf{name: "system:kube-scheduler", client: true}},
		{"client-ca", "client-kube-apiserver", leaf{name: "system:apiserver", groups: []string{"system:masters"}, client: true}},
		{"request-header-ca", "client-auth-proxy", leaf{name: "system:auth-proxy", client: true}},
		{"etcd/server-ca", "etcd/server-client", leaf{name: "etcd-server", names: etcdNames, client: true, server: true}},
		{"etcd/server-ca", "etcd/client", leaf{name: "etcd-client", client: true}},
		{"etcd/peer-ca", "etcd/peer-server-client", leaf{name: "etcd-peer", names: etcdNames, client: true, server: true}},
	} {
		if err := cas[wanted.ca].ensureLeaf(c.dataDir.tls(wanted.base), wanted.leaf); err != nil {
			return err
		}
	}
	return nil
}
