package main

import (
	"context"
	"fmt"
	"os"
	"os/exec"
	"slices"
	"strings"
	"syscall"
	"time"

	"google.golang.org/protobuf/encoding/protojson"
	"google.golang.org/protobuf/proto"
	cri "k8s.io/cri-api/pkg/apis/runtime/v1"
)

// ctrCommand becomes the host's ctr, by default with k3s's containerd.
func ctrCommand(args []string) error {
	program, err := exec.LookPath("ctr")
	if err != nil {
		return err
	}
	for name, value := range map[string]string{"CONTAINERD_ADDRESS": containerdSocket, "CONTAINERD_NAMESPACE": "k8s.io"} {
		if os.Getenv(name) == "" {
			os.Setenv(name, value)
		}
	}
	return syscall.Exec(program, append([]string{"ctr"}, args...), os.Environ())
}

// crictlCommand answers what the collection asks of crictl, word by word.
func crictlCommand(args []string) error {
	conn, err := dialCRI()
	if err != nil {
		return err
	}
	defer conn.Close()
	ctx, cancel := context.WithTimeout(context.Background(), 10*time.Minute)
	defer cancel()
	images := cri.NewImageServiceClient(conn)
	switch {
	case slices.Equal(args, []string{"images", "-o", "json"}):
		reply, err := images.ListImages(ctx, &cri.ListImagesRequest{})
		if err != nil {
			return err
		}
		return printJSON(reply)
	case slices.Equal(args, []string{"ps", "-a", "-o", "json"}):
		reply, err := cri.NewRuntimeServiceClient(conn).ListContainers(ctx, &cri.ListContainersRequest{})
		if err != nil {
			return err
		}
		return printJSON(reply)
	case len(args) == 2 && args[0] == "pull":
		reply, err := images.PullImage(ctx, &cri.PullImageRequest{Image: &cri.ImageSpec{Image: args[1]}})
		if err != nil {
			return err
		}
		fmt.Printf("Image is up to date for %s\n", reply.ImageRef)
		return nil
	}
	return fmt.Errorf("labk3s lacks `crictl %s` (it has images -o json, ps -a -o json, pull IMAGE)", strings.Join(args, " "))
}

// printJSON writes a reply as crictl does: numbers of 64 bits as strings and
// empty fields included.
func printJSON(message proto.Message) error {
	content, err := protojson.MarshalOptions{EmitUnpopulated: true}.Marshal(message)
	if err != nil {
		return err
	}
	_, err = fmt.Println(string(content))
	return err
}
