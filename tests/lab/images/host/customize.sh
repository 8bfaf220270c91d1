#!/bin/sh
# Makes a Debian tree (first argument) a lab host: systemd in a privileged container must leave the machine under it alone.
set -eu
root=$1

# These act on what a privileged container shares with the machine: kernel variables, devices, swap, kernel file systems.
for unit in \
    dev-hugepages.mount proc-sys-fs-binfmt_misc.automount proc-sys-fs-binfmt_misc.mount sys-fs-fuse-connections.mount \
    sys-kernel-config.mount sys-kernel-debug.mount sys-kernel-tracing.mount \
    systemd-binfmt.service systemd-modules-load.service systemd-remount-fs.service systemd-sysctl.service \
    systemd-udevd.service systemd-udev-trigger.service \
    console-getty.service getty.target e2scrub_all.timer fstrim.timer apt-daily.timer apt-daily-upgrade.timer; do
    ln -sf /dev/null "$root/etc/systemd/system/$unit"
done

# k3s brings its own containerd, or starts Debian's with a configuration of its own.
rm -f "$root/etc/systemd/system/multi-user.target.wants/containerd.service"

# systemd leaves the propagation of mounts alone in a container; the kubelet needs it shared.
cat > "$root/etc/systemd/system/lab-shared-mounts.service" <<'UNIT'
[Unit]
Description=Share mounts with pods
DefaultDependencies=no
Before=sysinit.target

[Service]
Type=oneshot
ExecStart=/bin/mount --make-rshared /
RemainAfterExit=yes

[Install]
WantedBy=sysinit.target
UNIT
mkdir -p "$root/etc/systemd/system/sysinit.target.wants"
ln -sf ../lab-shared-mounts.service "$root/etc/systemd/system/sysinit.target.wants/lab-shared-mounts.service"

# What udev does, by its 99-systemd.rules, when the bridge of the pods appears. udev does not run here.
cat > "$root/etc/systemd/system/lab-bridge.service" <<'UNIT'
[Unit]
Description=Variables of the kernel for the bridge of the pods
DefaultDependencies=no

[Service]
ExecStart=/bin/sh -c 'ip -o monitor link | while read -r line; do case "$line" in *cni0*) /lib/systemd/systemd-sysctl --prefix=/net/ipv4/neigh/cni0;; esac; done'
UNIT
ln -sf ../lab-bridge.service "$root/etc/systemd/system/sysinit.target.wants/lab-bridge.service"

# The lab gives each host its key: known_hosts is written before the first boot, and host key checking stays on.
rm -f "$root"/etc/ssh/ssh_host_*_key "$root"/etc/ssh/ssh_host_*_key.pub
cat > "$root/etc/ssh/sshd_config.d/lab.conf" <<'CONF'
HostKey /etc/ssh/ssh_host_ed25519_key
PermitRootLogin prohibit-password
PasswordAuthentication no
UseDNS no
MaxSessions 50
MaxStartups 50:30:100
CONF

mkdir -p "$root/var/log/journal" "$root/etc/systemd/journald.conf.d"
printf '[Journal]\nSystemMaxUse=100M\nAudit=no\n' > "$root/etc/systemd/journald.conf.d/lab.conf"
: > "$root/etc/machine-id"
rm -f "$root/etc/hostname"
