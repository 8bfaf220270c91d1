package main

import (
	"context"
	"crypto/rand"
	"errors"
	"fmt"
	"math/big"
	"os"
	"strings"
	"text/tabwriter"
	"time"

	corev1 "k8s.io/api/core/v1"
	metav1 "k8s.io/apimachinery/pkg/apis/meta/v1"
	"k8s.io/client-go/kubernetes"
	"k8s.io/client-go/tools/clientcmd"
)

const bootstrapSecretPrefix = "bootstrap-token-"

// tokenCommand is `k3s token`: tokens that agents can join with for a while.
func tokenCommand(args []string) error {
	if len(args) == 0 {
		return errors.New("k3s token: create, list, delete or generate is wanted")
	}
	command, rest := args[0], args[1:]
	ttl, description, kubeconfig := 24*time.Hour, "", os.Getenv("KUBECONFIG")
	if kubeconfig == "" {
		kubeconfig = etcDir + "/k3s.yaml"
	}
	var names []string
	for i := 0; i < len(rest); i++ {
		if !strings.HasPrefix(rest[i], "-") {
			names = append(names, rest[i])
			continue
		}
		name, value, hasValue := strings.Cut(strings.TrimLeft(rest[i], "-"), "=")
		if name != "ttl" && name != "description" && name != "kubeconfig" {
			return fmt.Errorf("labk3s lacks the flag --%s of `k3s token %s`", name, command)
		}
		if !hasValue {
			if i++; i >= len(rest) {
				return fmt.Errorf("flag --%s needs a value", name)
			}
			value = rest[i]
		}
		var err error
		switch name {
		case "ttl":
			ttl, err = time.ParseDuration(value)
		case "description":
			description = value
		case "kubeconfig":
			kubeconfig = value
		}
		if err != nil {
			return fmt.Errorf("flag --%s: %w", name, err)
		}
	}
	if command == "generate" {
		fmt.Println(newBootstrapToken())
		return nil
	}
	switch command {
	case "create", "list", "delete":
	default:
		return fmt.Errorf("labk3s lacks `k3s token %s` (it has create, list, delete, generate)", command)
	}
	rest2, err := clientcmd.BuildConfigFromFlags("", kubeconfig)
	if err != nil {
		return err
	}
	kube, err := kubernetes.NewForConfig(rest2)
	if err != nil {
		return err
	}
	ctx, cancel := context.WithTimeout(context.Background(), 30*time.Second)
	defer cancel()
	switch command {
	case "create":
		value := newBootstrapToken()
		if len(names) > 0 {
			value = names[0]
		}
		if err := createBootstrapToken(ctx, kube, value, description, ttl); err != nil {
			return err
		}
		t, err := parseToken(value, "")
		if err != nil {
			return err
		}
		t.caHash = hashCA(rest2.CAData)
		fmt.Println(t)
		return nil
	case "delete":
		if len(names) == 0 {
			return errors.New("missing token to delete")
		}
		for _, name := range names {
			id, _, _ := strings.Cut(name, ".")
			if err := kube.CoreV1().Secrets(metav1.NamespaceSystem).Delete(ctx, bootstrapSecretPrefix+id, metav1.DeleteOptions{}); err != nil {
				return err
			}
			fmt.Printf("bootstrap token %q deleted\n", id)
		}
		return nil
	default:
		return listBootstrapTokens(ctx, kube)
	}
}

func newBootstrapToken() string {
	const letters = "abcdefghijklmnopqrstuvwxyz0123456789"
	random := make([]byte, 22)
	for i := range random {
		n, err := rand.Int(rand.Reader, big.NewInt(int64(len(letters))))
		if err != nil {
			panic(err) // crypto/rand does not fail
		}
		random[i] = letters[n.Int64()]
	}
	return string(random[:6]) + "." + string(random[6:])
}

func createBootstrapToken(ctx context.Context, kube kubernetes.Interface, value, description string, ttl time.Duration) error {
	m := bootstrapToken.FindStringSubmatch(value)
	if m == nil {
		return fmt.Errorf("the token %q is not of the form abcdef.0123456789abcdef", value)
	}
	data := map[string]string{
		"token-id": m[1], "token-secret": m[2], "usage-bootstrap-authentication": "true",
		"usage-bootstrap-signing": "true", "auth-extra-groups": "system:bootstrappers:k3s:default-node-token",
	}
	if description != "" {
		data["description"] = description
	}
	if ttl > 0 {
		data["expiration"] = time.Now().Add(ttl).UTC().Format(time.RFC3339)
	}
	_, err := kube.CoreV1().Secrets(metav1.NamespaceSystem).Create(ctx, &corev1.Secret{
		ObjectMeta: metav1.ObjectMeta{Name: bootstrapSecretPrefix + m[1]},
		Type:       corev1.SecretTypeBootstrapToken,
		StringData: data,
	}, metav1.CreateOptions{})
	return err
}

func listBootstrapTokens(ctx context.Context, kube kubernetes.Interface) error {
	secrets, err := kube.CoreV1().Secrets(metav1.NamespaceSystem).List(ctx, metav1.ListOptions{
		FieldSelector: "type=" + string(corev1.SecretTypeBootstrapToken),
	})
	if err != nil {
		return err
	}
	w := tabwriter.NewWriter(os.Stdout, 0, 0, 3, ' ', 0)
	fmt.Fprintln(w, "TOKEN\tEXPIRES\tDESCRIPTION")
	for _, secret := range secrets.Items {
		expires := string(secret.Data["expiration"])
		if expires == "" {
			expires = "<never>"
		}
		fmt.Fprintf(w, "%s.%s\t%s\t%s\n", secret.Data["token-id"], secret.Data["token-secret"], expires, secret.Data["description"])
	}
	return w.Flush()
}

// bootstrapTokenValid is the supervisor's side. The token cleaner of the
// controller manager removes the expired ones, but only after a while.
func bootstrapTokenValid(ctx context.Context, kube kubernetes.Interface, id, secret string) bool {
	found, err := kube.CoreV1().Secrets(metav1.NamespaceSystem).Get(ctx, bootstrapSecretPrefix+id, metav1.GetOptions{})
	if err != nil || found.Type != corev1.SecretTypeBootstrapToken || !same(string(found.Data["token-secret"]), secret) {
		return false
	}
	if expiration := string(found.Data["expiration"]); expiration != "" {
		end, err := time.Parse(time.RFC3339, expiration)
		if err != nil || time.Now().After(end) {
			return false
		}
	}
	return string(found.Data["usage-bootstrap-authentication"]) == "true"
}
