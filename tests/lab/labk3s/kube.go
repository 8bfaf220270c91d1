package main

import (
	"fmt"
	"os"
	"path/filepath"

	"k8s.io/client-go/rest"
	"k8s.io/client-go/tools/clientcmd"
	clientcmdapi "k8s.io/client-go/tools/clientcmd/api"
)

// writeKubeconfig makes a kubeconfig for a certificate at base+".crt". With
// embed its contents are in it, as in k3s.yaml; else it names the files.
func writeKubeconfig(path, server, caFile, base string, embed bool, mode os.FileMode) error {
	config := clientcmdapi.Config{
		Clusters:       map[string]*clientcmdapi.Cluster{"default": {Server: server, CertificateAuthority: caFile}},
		AuthInfos:      map[string]*clientcmdapi.AuthInfo{"default": {ClientCertificate: base + ".crt", ClientKey: base + ".key"}},
		Contexts:       map[string]*clientcmdapi.Context{"default": {Cluster: "default", AuthInfo: "default"}},
		CurrentContext: "default",
	}
	if embed {
		if err := clientcmdapi.FlattenConfig(&config); err != nil {
			return err
		}
	}
	content, err := clientcmd.Write(config)
	if err != nil {
		return err
	}
	if _, err := writeFile(path, content, mode); err != nil {
		return fmt.Errorf("writing %s: %w", filepath.Base(path), err)
	}
	return nil
}

// restConfig is the access of our own controllers.
func restConfig(server, caFile, base string) *rest.Config {
	return &rest.Config{
		Host:            server,
		UserAgent:       "labk3s/" + version,
		TLSClientConfig: rest.TLSClientConfig{CAFile: caFile, CertFile: base + ".crt", KeyFile: base + ".key"},
		QPS:             50,
		Burst:           100,
	}
}
