# What the tests on a real kernel share. Sourced in the project's folder, by a script that has set `build` and `name`.

say() { echo "$name: $*"; }

# Sets `work`: what is fetched and made for these tests, below the build folder.
vm_prepare() {
  .ci/install build vm
  work=$(mkdir -p "$build/vm" && cd "$build/vm" && pwd)
  [ -e "$build/CMakeCache.txt" ] || cmake --preset release >/dev/null
}

# vm_fetch PACKAGE FOLDER: unpacked there, not installed; once.
vm_fetch() {
  [ -e "$work/$2/.done" ] && return
  say "fetching $1"
  rm -rf "${work:?}/$2" "$work/fetch" && mkdir -p "$work/$2" "$work/fetch"
  (cd "$work/fetch" && apt-get download -qq "$1" 2>/dev/null)
  dpkg -x "$work"/fetch/*.deb "$work/$2"
  rm -rf "$work/fetch"
  touch "$work/$2/.done"
}

# Sets `kernel_package`, `kernel_root` and `version`.
vm_fetch_kernel() {
  kernel_package=$(apt-cache depends linux-image-amd64 | sed -n 's/.*Depends: \(linux-image-.*\)/\1/p' | head -1)
  [ -n "$kernel_package" ] || { echo "$name: apt knows no linux-image-amd64: run apt-get update" >&2; exit 2; }
  kernel_root=$work/kernel-$kernel_package
  version=${kernel_package#linux-image-}
  vm_fetch "$kernel_package" "kernel-$kernel_package"
  [ -e "$kernel_root/lib/modules/$version/modules.dep" ] || /sbin/depmod -b "$kernel_root" "$version"
}

vm_build() {  # TARGET…
  cmake --build "$build" --target "$@" >"$work/build.log" 2>&1 || { tail -30 "$work/build.log" >&2; exit 1; }
}

# vm_libraries ROOT PROGRAM…: the shared libraries of programs, from this machine to where the programs look for them.
vm_libraries() {
  local into=$1 library
  shift
  while read -r library; do
    [ -e "$into$library" ] || { mkdir -p "$into$(dirname "$library")" && cp -L "$library" "$into$library"; }
  done < <(ldd "$@" | grep -o '[[:space:]]/[^ ]*' | tr -d ' \t' | sort -u)
}

# vm_modules ROOT NAME…: kernel modules and what they need; ROOT/modules/order has them in the order of loading.
vm_modules() {
  local into=$1 module path file
  shift
  mkdir -p "$into/modules"
  : >"$into/modules/order"
  for module in "$@"; do
    while read -r _ path _; do
      file=$(basename "$path")
      [ -f "$path" ] && [ ! -e "$into/modules/$file" ] || continue  # built in, or there already
      cp "$path" "$into/modules/"
      echo "/modules/$file" >>"$into/modules/order"
    done < <(/sbin/modprobe -d "$kernel_root" -S "$version" --show-depends "$module")
  done
}

# vm_boot SECONDS_MAX ROOT QEMU_OPTION…: boots ROOT as the initial file system. What the VM prints is shown and kept; it is
# over when the VM powers off. The line "VM-RESULT n" that it printed last is the result, in `result`; empty: none came.
vm_boot() {
  local seconds=$1 from=$2 begin=$SECONDS
  shift 2
  (cd "$from" && find . | cpio --quiet -o -H newc -R 0:0) >"$from.cpio"
  say "booting $kernel_package"
  timeout "$seconds" qemu-system-x86_64 -accel tcg -cpu max -smp 1 -nographic -no-reboot -nodefaults -serial stdio \
    -kernel "$kernel_root/boot/vmlinuz-$version" -initrd "$from.cpio" "$@" \
    </dev/null 2>&1 | sed -u 's/\r//g; s/\x1b\[[?0-9;]*[a-zA-Z]//g; s/\x1bc//g' | tee "$from.console.txt" || true
  result=$(sed -n 's/^VM-RESULT //p' "$from.console.txt" | tail -1)
  say "result ${result:-none (the VM did not come to its end)}; VM $((SECONDS - begin)) s, whole run $SECONDS s"
}
