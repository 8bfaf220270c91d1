package main

import (
	"bytes"
	"context"
	"errors"
	"os"
	"testing"
)

func encrypting(t *testing.T, encrypts bool) *config {
	t.Helper()
	return &config{dataDir: dataDir(t.TempDir()), NodeName: "edge1", NodeIP: "127.0.0.1", SecretsEncryption: encrypts}
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
