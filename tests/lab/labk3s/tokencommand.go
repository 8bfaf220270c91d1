package main

import (
	"context"
	"encoding/json"
	"flag"
	"fmt"
	"io"
	"os"
	"strings"
	"time"

	metav1 "k8s.io/apimachinery/pkg/apis/meta/v1"
	"k8s.io/client-go/kubernetes"
	"k8s.io/client-go/tools/clientcmd"
	bootstrapapi "k8s.io/cluster-bootstrap/token/api"
	bootstraputil "k8s.io/cluster-bootstrap/token/util"
	bootstraptoken "k8s.io/kubernetes/cmd/kubeadm/app/apis/bootstraptoken/v1"
)

// joiners is the group that k3s gives its bootstrap tokens.
const joiners = "system:bootstrappers:k3s:default-node-token"

// tokenCommand is `k3s token`: bootstrap tokens, which are Secrets of
// kube-system that the API server itself knows.
func tokenCommand(args []string) error {
	if len(args) > 0 && args[0] == "rotate" {
		return rotateToken(defaultDataDir, "https://127.0.0.1:"+apiPort, args[1:])
	}
	config, err := clientcmd.BuildConfigFromFlags("", kubeconfigFile)
	if err != nil {
		return err
	}
	kube, err := kubernetes.NewForConfig(config)
	if err != nil {
		return err
	}
	ctx, cancel := context.WithTimeout(context.Background(), time.Minute)
	defer cancel()
	return runToken(ctx, kube, config.CAData, args, os.Stdout)
}

func runToken(ctx context.Context, kube kubernetes.Interface, ca []byte, args []string, out io.Writer) error {
	command := ""
	if len(args) > 0 {
		command, args = args[0], args[1:]
	}
	flags := flag.NewFlagSet("k3s token "+command, flag.ContinueOnError)
	secrets := kube.CoreV1().Secrets(metav1.NamespaceSystem)
	switch command {
	case "create":
		ttl := flags.Duration("ttl", 24*time.Hour, "")
		description := flags.String("description", "", "")
		if err := flags.Parse(args); err != nil {
			return err
		}
		made, err := bootstraputil.GenerateBootstrapToken()
		if err != nil {
			return err
		}
		parts, err := bootstraptoken.NewBootstrapTokenString(made)
		if err != nil {
			return err
		}
		secret := bootstraptoken.BootstrapTokenToSecret(&bootstraptoken.BootstrapToken{
			Token: parts, Description: *description, TTL: &metav1.Duration{Duration: *ttl}, // 0: without an end
			Usages: bootstrapapi.KnownTokenUsages, Groups: []string{joiners},
		})
		if _, err := secrets.Create(ctx, secret, metav1.CreateOptions{}); err != nil {
			return err
		}
		_, err = fmt.Fprintln(out, token{caHash: hashCA(ca), secret: made})
		return err
	case "list":
		output := flags.String("o", "", "")
		if err := flags.Parse(args); err != nil {
			return err
		}
		if *output != "json" {
			return fmt.Errorf("labk3s lacks `k3s token list` without -o json")
		}
		found, err := secrets.List(ctx, metav1.ListOptions{FieldSelector: "type=" + string(bootstrapapi.SecretTypeBootstrapToken)})
		if err != nil {
			return err
		}
		listed := []map[string]string{}
		for _, secret := range found.Items {
			listed = append(listed, map[string]string{
				"token":       string(secret.Data[bootstrapapi.BootstrapTokenIDKey]) + "." + string(secret.Data[bootstrapapi.BootstrapTokenSecretKey]),
				"description": string(secret.Data[bootstrapapi.BootstrapTokenDescriptionKey]),
				"expires":     string(secret.Data[bootstrapapi.BootstrapTokenExpirationKey]),
			})
		}
		return json.NewEncoder(out).Encode(listed)
	case "delete":
		if len(args) == 0 {
			return fmt.Errorf("missing argument; 'token delete' is missing token")
		}
		for _, given := range args {
			id, _, _ := strings.Cut(given, ".")
			if err := secrets.Delete(ctx, bootstraputil.BootstrapTokenSecretName(id), metav1.DeleteOptions{}); err != nil {
				return fmt.Errorf("failed to delete bootstrap token %q", err)
			}
			fmt.Fprintf(out, "bootstrap token %q deleted\n", id)
		}
		return nil
	}
	return fmt.Errorf("labk3s lacks `k3s token %s` (it has create, list, delete and rotate)", command)
}
