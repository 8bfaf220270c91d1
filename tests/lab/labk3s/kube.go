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
	cluster := &clientcmdapi.Cluster{Server: server}
	user := &clientcmdapi.AuthInfo{}
	if embed {
		for target, file := range map[*[]byte]string{
			&cluster.CertificateAuthorityData: caFile,
			&user.ClientCertificateData:       base + ".crt",
			&user.ClientKeyData:               base + ".key",
		} {
			content, err := os.ReadFile(file)
			if err != nil {
				return err
			}
			*target = content
		}
	} else {
		cluster.CertificateAuthority = caFile
		user.ClientCertificate = base + ".crt"
		user.ClientKey = base + ".key"
	}
	content, err := clientcmd.Write(clientcmdapi.Config{
		Clusters:       map[string]*clientcmdapi.Cluster{"default": cluster},
		AuthInfos:      map[string]*clientcmdapi.AuthInfo{"default": user},
		Contexts:       map[string]*clientcmdapi.Context{"default": {Cluster: "default", AuthInfo: "default"}},
		CurrentContext: "default",
	})
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
