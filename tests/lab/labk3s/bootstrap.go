package main

import (
	"context"
	"crypto/aes"
	"crypto/cipher"
	"crypto/pbkdf2"
	"crypto/rand"
	"crypto/sha256"
	"encoding/json"
	"errors"
	"fmt"
	"os"
	"strings"
	"time"

	clientv3 "go.etcd.io/etcd/client/v3"
)

// bootstrap is what all servers of a cluster share: the authorities, the
// service account key and the secrets. A joining server gets it from the one
// it joins; it also lies in the datastore, encrypted with the token, so that a
// snapshot restored on an empty host brings the cluster's identity along.
type bootstrap map[string]string

func sharedFiles() []string {
	files := []string{"service.key"}
	for _, ca := range caNames {
		files = append(files, ca+".crt", ca+".key")
	}
	return files
}

func readBootstrap(d dataDir) (bootstrap, error) {
	b := bootstrap{}
	for _, name := range sharedFiles() {
		content, err := os.ReadFile(d.tls(name))
		if err != nil {
			return nil, err
		}
		b[name] = string(content)
	}
	return b, nil
}

// write puts the shared files in place and reports whether any changed.
func (b bootstrap) write(d dataDir) (bool, error) {
	any := false
	for _, name := range sharedFiles() {
		content, ok := b[name]
		if !ok {
			return any, fmt.Errorf("bootstrap data lacks %s", name)
		}
		mode := os.FileMode(0o600)
		if strings.HasSuffix(name, ".crt") {
			mode = 0o644
		}
		changed, err := writeFile(d.tls(name), []byte(content), mode)
		if err != nil {
			return any, err
		}
		any = any || changed
	}
	return any, nil
}

const bootstrapPrefix = "/bootstrap/"

func bootstrapKey(secret string) string {
	return bootstrapPrefix + hashCA([]byte(secret))[:12]
}

var errOtherToken = errors.New("bootstrap data already found and encrypted with different token")

// loadBootstrap reads the datastore's copy; nil means there is none yet.
func loadBootstrap(ctx context.Context, client *clientv3.Client, secret string) (bootstrap, error) {
	ctx, cancel := context.WithTimeout(ctx, 30*time.Second)
	defer cancel()
	got, err := client.Get(ctx, bootstrapPrefix, clientv3.WithPrefix())
	if err != nil {
		return nil, fmt.Errorf("reading bootstrap data: %w", err)
	}
	if len(got.Kvs) == 0 {
		return nil, nil
	}
	for _, kv := range got.Kvs {
		if string(kv.Key) != bootstrapKey(secret) {
			continue
		}
		plain, err := unseal(kv.Value, secret)
		if err != nil {
			return nil, errOtherToken
		}
		b := bootstrap{}
		return b, json.Unmarshal(plain, &b)
	}
	return nil, errOtherToken
}

func saveBootstrap(ctx context.Context, client *clientv3.Client, d dataDir, secret string) error {
	b, err := readBootstrap(d)
	if err != nil {
		return err
	}
	plain, err := json.Marshal(b)
	if err != nil {
		return err
	}
	sealed, err := seal(plain, secret)
	if err != nil {
		return err
	}
	ctx, cancel := context.WithTimeout(ctx, 10*time.Second)
	defer cancel()
	_, err = client.Put(ctx, bootstrapKey(secret), string(sealed))
	return err
}

const saltLen = 16

func seal(plain []byte, secret string) ([]byte, error) {
	salt := make([]byte, saltLen)
	rand.Read(salt)
	aead, err := cipherFor(secret, salt)
	if err != nil {
		return nil, err
	}
	return aead.Seal(salt, nil, plain, nil), nil
}

func unseal(sealed []byte, secret string) ([]byte, error) {
	if len(sealed) < saltLen {
		return nil, errors.New("too short")
	}
	aead, err := cipherFor(secret, sealed[:saltLen])
	if err != nil {
		return nil, err
	}
	return aead.Open(nil, nil, sealed[saltLen:], nil)
}

func cipherFor(secret string, salt []byte) (cipher.AEAD, error) {
	key, err := pbkdf2.Key(sha256.New, secret, salt, 4096, 32)
	if err != nil {
		return nil, err
	}
	block, err := aes.NewCipher(key)
	if err != nil {
		return nil, err
	}
	return cipher.NewGCMWithRandomNonce(block)
}
