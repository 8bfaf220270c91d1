package main

import (
	"crypto/rand"
	"encoding/base64"
	"encoding/json"
)

// encryptionFile holds the key with which the API server encrypts Secrets in
// the datastore, if it was told to.
func (c *config) encryptionFile() string {
	return c.dataDir.server("cred", "encryption-config.json")
}

// ensureEncryption makes that file once, as k3s does: what is written from
// then on is encrypted, and what is there in plain text can still be read.
func ensureEncryption(c *config) error {
	if !c.SecretsEncryption || exists(c.encryptionFile()) {
		return nil
	}
	key := make([]byte, 32)
	if _, err := rand.Read(key); err != nil {
		return err
	}
	keys := []map[string]string{{"name": "aescbckey", "secret": base64.StdEncoding.EncodeToString(key)}}
	content, err := json.Marshal(map[string]any{
		"kind": "EncryptionConfiguration", "apiVersion": "apiserver.config.k8s.io/v1",
		"resources": []map[string]any{{
			"resources": []string{"secrets"},
			"providers": []map[string]any{
				{"aescbc": map[string]any{"keys": keys}},
				{"identity": map[string]any{}},
			},
		}},
	})
	if err != nil {
		return err
	}
	_, err = writeFile(c.encryptionFile(), content, 0o600)
	return err
}
