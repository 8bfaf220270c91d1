package main

import (
	"bytes"
	"context"
	"encoding/json"
	"errors"
	"fmt"
	"os"
	"os/exec"
	"regexp"
	"strconv"
	"strings"
	"syscall"
	"text/tabwriter"
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

// criCall is one invocation of `k3s crictl`.
type criCall struct {
	ctx     context.Context
	runtime cri.RuntimeServiceClient
	images  cri.ImageServiceClient
	flags   map[string]string
	names   []string
}

// criCommands are the commands with the flags (short: long) that each has; a
// flag that ends in "=" takes a value.
var criCommands = map[string]struct {
	flags map[string]string
	run   func(*criCall) error
}{
	"images":   {map[string]string{"o": "output=", "q": "quiet", "": "digests no-trunc verbose"}, (*criCall).listImages},
	"ps":       {map[string]string{"o": "output=", "q": "quiet", "a": "all", "": "name= state= pod= no-trunc"}, (*criCall).listContainers},
	"pods":     {map[string]string{"o": "output=", "q": "quiet", "": "name= namespace= state= no-trunc"}, (*criCall).listPods},
	"inspecti": {map[string]string{"o": "output=", "q": "quiet"}, (*criCall).inspectImages},
	"rmi":      {map[string]string{"a": "all", "q": "prune"}, (*criCall).removeImages},
	"pull":     {nil, (*criCall).pullImages},
	"info":     {map[string]string{"o": "output=", "q": "quiet"}, (*criCall).info},
	"version":  {nil, (*criCall).version},
}

func crictlCommand(args []string) error {
	for len(args) > 0 && strings.HasPrefix(args[0], "-") {
		return fmt.Errorf("labk3s lacks crictl's global flag %s", args[0])
	}
	if len(args) == 0 {
		return errors.New("crictl: a command is wanted: " + strings.Join(sortedKeys(criCommands), ", "))
	}
	name := args[0]
	switch name {
	case "image", "img":
		name = "images"
	}
	command, ok := criCommands[name]
	if !ok {
		return fmt.Errorf("labk3s lacks `crictl %s` (it has %s)", name, strings.Join(sortedKeys(criCommands), ", "))
	}
	flags, names, err := parseCRIFlags(name, command.flags, args[1:])
	if err != nil {
		return err
	}
	conn, err := dialCRI()
	if err != nil {
		return err
	}
	defer conn.Close()
	limit := 30 * time.Second
	if name == "pull" {
		limit = 10 * time.Minute
	}
	ctx, cancel := context.WithTimeout(context.Background(), limit)
	defer cancel()
	return command.run(&criCall{ctx, cri.NewRuntimeServiceClient(conn), cri.NewImageServiceClient(conn), flags, names})
}

func parseCRIFlags(command string, known map[string]string, args []string) (map[string]string, []string, error) {
	takesValue, long := map[string]bool{}, map[string]string{}
	for short, all := range known {
		for _, name := range strings.Fields(all) {
			plain := strings.TrimSuffix(name, "=")
			takesValue[plain] = plain != name
			long[plain] = plain
			if short != "" {
				long[short] = plain
			}
		}
	}
	flags, names := map[string]string{}, []string{}
	for i := 0; i < len(args); i++ {
		if !strings.HasPrefix(args[i], "-") {
			names = append(names, args[i])
			continue
		}
		given, value, hasValue := strings.Cut(strings.TrimLeft(args[i], "-"), "=")
		name, ok := long[given]
		switch {
		case !ok:
			return nil, nil, fmt.Errorf("labk3s lacks the flag %s of `crictl %s`", args[i], command)
		case !takesValue[name] && !hasValue:
			value = "true"
		case !hasValue:
			if i++; i >= len(args) {
				return nil, nil, fmt.Errorf("flag --%s needs a value", name)
			}
			value = args[i]
		}
		flags[name] = value
	}
	switch flags["output"] {
	case "", "json", "table":
	default:
		return nil, nil, fmt.Errorf("labk3s lacks the output %q of `crictl %s` (it has json, table)", flags["output"], command)
	}
	return flags, names, nil
}

// printJSON writes a reply as crictl does: numbers of 64 bits as strings and
// empty fields included.
func printJSON(message proto.Message) error {
	content, err := protojson.MarshalOptions{EmitUnpopulated: true}.Marshal(message)
	if err != nil {
		return err
	}
	return printIndented(content)
}

func printIndented(content []byte) error {
	// protojson varies its spaces on purpose.
	var out bytes.Buffer
	if err := json.Indent(&out, content, "", "  "); err != nil {
		return err
	}
	out.WriteByte('\n')
	_, err := out.WriteTo(os.Stdout)
	return err
}

func table(header string, rows [][]string) error {
	w := tabwriter.NewWriter(os.Stdout, 0, 0, 3, ' ', 0)
	fmt.Fprintln(w, header)
	for _, row := range rows {
		fmt.Fprintln(w, strings.Join(row, "\t"))
	}
	return w.Flush()
}

func (c *criCall) printIDs(ids []string) error {
	for _, id := range ids {
		fmt.Println(id)
	}
	return nil
}

func short(id string) string {
	id = strings.TrimPrefix(id, "sha256:")
	return id[:min(13, len(id))]
}

func age(nanoseconds int64) string {
	return time.Since(time.Unix(0, nanoseconds)).Round(time.Second).String() + " ago"
}

func (c *criCall) listImages() error {
	request := &cri.ListImagesRequest{}
	if len(c.names) > 0 {
		request.Filter = &cri.ImageFilter{Image: &cri.ImageSpec{Image: c.names[0]}}
	}
	reply, err := c.images.ListImages(c.ctx, request)
	if err != nil {
		return err
	}
	if c.flags["output"] == "json" {
		return printJSON(reply)
	}
	var ids []string
	var rows [][]string
	for _, image := range reply.Images {
		ids = append(ids, image.Id)
		size := strconv.FormatFloat(float64(image.Size)/1e6, 'f', 1, 64) + "MB"
		tags := image.RepoTags
		if len(tags) == 0 {
			tags = []string{"<none>:<none>"}
		}
		for _, tag := range tags {
			i := strings.LastIndex(tag, ":")
			rows = append(rows, []string{tag[:i], tag[i+1:], short(image.Id), size})
		}
	}
	if c.flags["quiet"] == "true" {
		return c.printIDs(ids)
	}
	return table("IMAGE\tTAG\tIMAGE ID\tSIZE", rows)
}

func (c *criCall) listContainers() error {
	filter := &cri.ContainerFilter{}
	state := strings.ToUpper(c.flags["state"])
	if c.flags["all"] != "true" && state == "" {
		state = "RUNNING"
	}
	if state != "" {
		value, ok := cri.ContainerState_value["CONTAINER_"+state]
		if !ok {
			return fmt.Errorf("--state: %q is not a state", c.flags["state"])
		}
		filter.State = &cri.ContainerStateValue{State: cri.ContainerState(value)}
	}
	filter.PodSandboxId = c.flags["pod"]
	reply, err := c.runtime.ListContainers(c.ctx, &cri.ListContainersRequest{Filter: filter})
	if err != nil {
		return err
	}
	name, err := regexp.Compile(c.flags["name"])
	if err != nil {
		return fmt.Errorf("--name: %w", err)
	}
	kept := &cri.ListContainersResponse{}
	var ids []string
	var rows [][]string
	for _, container := range reply.Containers {
		if !name.MatchString(container.Metadata.GetName()) {
			continue
		}
		kept.Containers = append(kept.Containers, container)
		ids = append(ids, container.Id)
		rows = append(rows, []string{
			short(container.Id), short(container.Image.GetImage()), age(container.CreatedAt),
			strings.TrimPrefix(container.State.String(), "CONTAINER_"), container.Metadata.GetName(),
			fmt.Sprint(container.Metadata.GetAttempt()), short(container.PodSandboxId), container.Labels["io.kubernetes.pod.name"],
		})
	}
	switch {
	case c.flags["output"] == "json":
		return printJSON(kept)
	case c.flags["quiet"] == "true":
		return c.printIDs(ids)
	}
	return table("CONTAINER\tIMAGE\tCREATED\tSTATE\tNAME\tATTEMPT\tPOD ID\tPOD", rows)
}

func (c *criCall) listPods() error {
	filter := &cri.PodSandboxFilter{}
	if state := strings.ToUpper(c.flags["state"]); state != "" {
		value, ok := cri.PodSandboxState_value["SANDBOX_"+state]
		if !ok {
			return fmt.Errorf("--state: %q is not a state", c.flags["state"])
		}
		filter.State = &cri.PodSandboxStateValue{State: cri.PodSandboxState(value)}
	}
	reply, err := c.runtime.ListPodSandbox(c.ctx, &cri.ListPodSandboxRequest{Filter: filter})
	if err != nil {
		return err
	}
	name, err := regexp.Compile(c.flags["name"])
	if err != nil {
		return fmt.Errorf("--name: %w", err)
	}
	kept := &cri.ListPodSandboxResponse{}
	var ids []string
	var rows [][]string
	for _, pod := range reply.Items {
		namespace := c.flags["namespace"]
		if !name.MatchString(pod.Metadata.GetName()) || namespace != "" && namespace != pod.Metadata.GetNamespace() {
			continue
		}
		kept.Items = append(kept.Items, pod)
		ids = append(ids, pod.Id)
		rows = append(rows, []string{
			short(pod.Id), age(pod.CreatedAt), strings.TrimPrefix(pod.State.String(), "SANDBOX_"),
			pod.Metadata.GetName(), pod.Metadata.GetNamespace(), fmt.Sprint(pod.Metadata.GetAttempt()),
		})
	}
	switch {
	case c.flags["output"] == "json":
		return printJSON(kept)
	case c.flags["quiet"] == "true":
		return c.printIDs(ids)
	}
	return table("POD ID\tCREATED\tSTATE\tNAME\tNAMESPACE\tATTEMPT", rows)
}

func (c *criCall) inspectImages() error {
	if len(c.names) == 0 {
		return errors.New("ID cannot be empty")
	}
	for _, name := range c.names {
		reply, err := c.images.ImageStatus(c.ctx, &cri.ImageStatusRequest{Image: &cri.ImageSpec{Image: name}, Verbose: true})
		if err != nil {
			return err
		}
		if reply.Image == nil {
			return fmt.Errorf("no such image %q present", name)
		}
		status, err := protojson.MarshalOptions{EmitUnpopulated: true}.Marshal(reply.Image)
		if err != nil {
			return err
		}
		if err := printVerbose(status, reply.Info); err != nil {
			return err
		}
	}
	return nil
}

// printVerbose joins a status with the runtime's own details, which come as
// JSON in strings.
func printVerbose(status []byte, details map[string]string) error {
	joined := map[string]json.RawMessage{"status": status}
	for key, value := range details {
		if json.Valid([]byte(value)) {
			// crictl shows the entry "info" of a reply as "info" itself.
			joined[key] = json.RawMessage(value)
		} else if content, err := json.Marshal(value); err == nil {
			joined[key] = content
		}
	}
	content, err := json.Marshal(joined)
	if err != nil {
		return err
	}
	return printIndented(content)
}

func (c *criCall) removeImages() error {
	names := c.names
	if c.flags["all"] == "true" || c.flags["prune"] == "true" {
		unused, err := c.imagesToRemove(c.flags["prune"] == "true")
		if err != nil {
			return err
		}
		names = unused
	} else if len(names) == 0 {
		return errors.New("ID cannot be empty")
	}
	var failed []error
	for _, name := range names {
		status, err := c.images.ImageStatus(c.ctx, &cri.ImageStatusRequest{Image: &cri.ImageSpec{Image: name}})
		if err == nil && status.Image == nil {
			err = errors.New("no such image")
		}
		if err == nil {
			_, err = c.images.RemoveImage(c.ctx, &cri.RemoveImageRequest{Image: &cri.ImageSpec{Image: name}})
		}
		if err != nil {
			failed = append(failed, fmt.Errorf("%s: %w", name, err))
			continue
		}
		for _, tag := range status.Image.RepoTags {
			fmt.Println("Deleted: " + tag)
		}
	}
	return errors.Join(failed...)
}

func (c *criCall) imagesToRemove(unusedOnly bool) ([]string, error) {
	images, err := c.images.ListImages(c.ctx, &cri.ListImagesRequest{})
	if err != nil {
		return nil, err
	}
	used := map[string]bool{}
	if unusedOnly {
		containers, err := c.runtime.ListContainers(c.ctx, &cri.ListContainersRequest{})
		if err != nil {
			return nil, err
		}
		for _, container := range containers.Containers {
			used[container.ImageRef] = true
			used[container.Image.GetImage()] = true
		}
	}
	var ids []string
	for _, image := range images.Images {
		inUse := used[image.Id] || image.Pinned
		for _, digest := range image.RepoDigests {
			inUse = inUse || used[digest]
		}
		for _, tag := range image.RepoTags {
			// The sandbox image belongs to no container that CRI lists.
			inUse = inUse || used[tag] || strings.Contains(tag, "/mirrored-pause:")
		}
		if !unusedOnly || !inUse {
			ids = append(ids, image.Id)
		}
	}
	return ids, nil
}

func (c *criCall) pullImages() error {
	if len(c.names) != 1 {
		return errors.New("pull takes one image")
	}
	reply, err := c.images.PullImage(c.ctx, &cri.PullImageRequest{Image: &cri.ImageSpec{Image: c.names[0]}})
	if err != nil {
		return err
	}
	fmt.Printf("Image is up to date for %s\n", reply.ImageRef)
	return nil
}

func (c *criCall) info() error {
	reply, err := c.runtime.Status(c.ctx, &cri.StatusRequest{Verbose: true})
	if err != nil {
		return err
	}
	status, err := protojson.MarshalOptions{EmitUnpopulated: true}.Marshal(reply.Status)
	if err != nil {
		return err
	}
	return printVerbose(status, reply.Info)
}

func (c *criCall) version() error {
	reply, err := c.runtime.Version(c.ctx, &cri.VersionRequest{})
	if err != nil {
		return err
	}
	fmt.Printf("Version:  %s\nRuntimeName:  %s\nRuntimeVersion:  %s\nRuntimeApiVersion:  %s\n",
		reply.Version, reply.RuntimeName, reply.RuntimeVersion, reply.RuntimeApiVersion)
	return nil
}
