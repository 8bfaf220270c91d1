package main

import (
	"bytes"
	"context"
	"errors"
	"os"
	"testing"

	"k8s.io/apimachinery/pkg/runtime/schema"
	"k8s.io/apiserver/pkg/server/options/encryptionconfig"
	"k8s.io/apiserver/pkg/storage/value"
)

func encrypting(t *testing.T, encrypts bool) *config {
	t.Helper()
	return &config{dataDir: dataDir(t.TempDir()), NodeName: "edge1", NodeIP: "127.0.0.1", SecretsEncryption: encrypts}
}

// The file is read by the code with which the API server reads it.
func TestSecretsAreEncryptedWithAKeyThatStays(t *testing.T) {
	c := encrypting(t, true)
	if err := ensureEncryption(c); err != nil {
		t.Fatal(err)
	}
	path := apiserverArgs(c)["encryption-provider-config"]
	first, err := os.ReadFile(path)
	if err != nil {
		t.Fatal(err)
	}
	if info, err := os.Stat(path); err != nil || info.Mode().Perm() != 0o600 {
		t.Errorf("got %v, %v", info, err)
	}
	loaded, err := encryptionconfig.LoadEncryptionConfig(context.Background(), path, false, "test")
	if err != nil {
		t.Fatal(err)
	}
	secrets := loaded.Transformers[schema.GroupResource{Resource: "secrets"}]
	where := value.DefaultContext("/registry/secrets/default/loot")
	kept, err := secrets.TransformToStorage(context.Background(), []byte("plain"), where)
	if err != nil || !bytes.HasPrefix(kept, []byte("k8s:enc:aescbc:v1:aescbckey:")) || bytes.Contains(kept, []byte("plain")) {
		t.Errorf("kept %q, %v", kept, err)
	}
	for _, there := range [][]byte{kept, []byte("plain")} { // also what was written before
		if read, _, err := secrets.TransformFromStorage(context.Background(), there, where); err != nil || string(read) != "plain" {
			t.Errorf("read %q, %v", read, err)
		}
	}
	if err := ensureEncryption(c); err != nil {
		t.Fatal(err)
	}
	if again, err := os.ReadFile(path); err != nil || !bytes.Equal(first, again) {
		t.Errorf("another key: %v", err)
	}
}

func TestNothingIsEncryptedUnasked(t *testing.T) {
	c := encrypting(t, false)
	if err := ensureEncryption(c); err != nil || exists(c.encryptionFile()) {
		t.Errorf("a key was made: %v", err)
	}
	if path, said := apiserverArgs(c)["encryption-provider-config"]; said {
		t.Errorf("got %s", path)
	}
}

func TestAServerThatJoinsHasTheClustersKey(t *testing.T) {
	for _, test := range []struct {
		cluster, joining bool
		want             error
	}{
		{true, true, nil},
		{false, false, nil},
		{true, false, errOtherEncryption},
		{false, true, errOtherEncryption},
	} {
		cluster, joining := encrypting(t, test.cluster), encrypting(t, test.joining)
		if err := ensureEncryption(cluster); err != nil {
			t.Fatal(err)
		}
		joining.ServerURL, joining.token = startSiteOf(t, cluster).url, "servers-secret"
		if _, err := prepareServer(context.Background(), joining); !errors.Is(err, test.want) {
			t.Errorf("%+v: got %v", test, err)
			continue
		}
		own, _ := os.ReadFile(cluster.encryptionFile())
		taken, _ := os.ReadFile(joining.encryptionFile())
		if test.want == nil && !bytes.Equal(own, taken) {
			t.Errorf("%+v: it has another key", test)
		}
	}
}
