# What the tests on a real kernel share. Sourced in the project's folder, by a script that has set `name`.

build=build/release
while [ $# -gt 0 ]; do
  case $1 in
    --build) build=${2:?a folder} && shift 2 ;;
    *) echo "usage: $name [--build DIR]" >&2; exit 2 ;;
  esac
done

say() { echo "$name: $*"; }

# Sets `work`: what is fetched and made for these tests, below the build folder.
vm_prepare() {
  .ci/install build vm
  work=$(mkdir -p "$build/vm" && cd "$build/vm" && pwd)
  [ -e "$build/CMakeCache.txt" ] || cmake --preset release >/dev/null
}

# vm_fetch FOLDER PACKAGE…: unpacked there, not installed; once.
vm_fetch() {
  local into=$work/$1 archive
  shift
  [ -e "$into/.done" ] && return
  say "fetching $*"
  rm -rf "$into" "$work/fetch" && mkdir -p "$into" "$work/fetch"
  (cd "$work/fetch" && apt-get download -qq "$@" 2>/dev/null) ||
    { echo "$name: apt-get download $* failed: run apt-get update, check the network" >&2; exit 2; }
  for archive in "$work"/fetch/*.deb; do dpkg -x "$archive" "$into"; done
  rm -rf "$work/fetch"
  touch "$into/.done"
}

# Sets `kernel_package`, `kernel_root` and `version`.
vm_fetch_kernel() {
  kernel_package=$(apt-cache depends linux-image-amd64 | sed -n 's/.*Depends: \(linux-image-.*\)/\1/p' | head -1)
  [ -n "$kernel_package" ] || { echo "$name: apt knows no linux-image-amd64: run apt-get update" >&2; exit 2; }
  kernel_root=$work/kernel-$kernel_package
  version=${kernel_package#linux-image-}
  vm_fetch "kernel-$kernel_package" "$kernel_package"
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

# vm_kernel_module FILE.c: built with the kernel's headers, as $work/module/FILE.ko.
vm_kernel_module() {
  local needs headers=$work/headers-$version
  mapfile -t needs < <(apt-cache depends "linux-headers-$version" | sed -n 's/.*Depends: \(linux-headers-.*\|linux-kbuild-.*\)/\1/p')
  vm_fetch "headers-$version" "linux-headers-$version" "${needs[@]}"
  echo "include $(echo "$headers"/usr/src/*-common)/Makefile" >"$headers/usr/src/linux-headers-$version/Makefile"
  rm -rf "$work/module" && mkdir "$work/module"
  cp "$1" "$work/module/"
  echo "obj-m := $(basename "$1" .c).o" >"$work/module/Makefile"
  make -C "$headers/usr/src/linux-headers-$version" M="$work/module" modules >"$work/module/log" 2>&1 ||
    { tail -30 "$work/module/log" >&2; exit 1; }
}

# vm_pack ROOT: as an initial file system, ROOT.cpio, that vm_boot boots.
vm_pack() {
  (cd "$1" && find . | cpio --quiet -o -H newc -R 0:0) >"$1.cpio"
  : >"$1.console.txt"
}

vm=  # its process
trap '[ -z "$vm" ] || kill -KILL "$vm" 2>/dev/null || true' EXIT

# vm_boot SECONDS_MAX ROOT QEMU_OPTION…: boots ROOT.cpio. Its time is counted in its instructions, so that a busy machine makes it
# slow but not late. Its processor has no AVX2, with which QEMU 7.2 computes wrongly.
# What the VM prints is shown, and kept in ROOT.console.txt. It ends when
# it powers off, after SECONDS_MAX, or by a power cut: the VM prints "VM-CUT words" and is killed at once; `cut` has the
# words. `result` is n of the line "VM-RESULT n" that it printed last. Empty: there was no such line.
vm_boot() {
  local from=$2 begin=$SECONDS left=$1 until=$((SECONDS + $1)) line code
  shift 2
  result='' cut=''
  say "booting $kernel_package"
  exec 7< <(exec qemu-system-x86_64 -accel tcg -icount shift=0 -cpu Nehalem -smp 1 \
    -nographic -no-reboot -nodefaults -serial stdio \
    -kernel "$kernel_root/boot/vmlinuz-$version" -initrd "$from.cpio" "$@" </dev/null 2>&1)
  vm=$!
  while [ "$left" -gt 0 ] && IFS= read -r -t "$left" -u 7 line; do
    left=$((until - SECONDS))
    line=${line//$'\r'/}
    while [[ $line =~ $'\e'(\[[?0-9;]*[a-zA-Z]|c) ]]; do code=${BASH_REMATCH[0]} line=${line/"$code"/}; done
    case $line in
      VM-RESULT\ *) result=${line#VM-RESULT } ;;
      VM-CUT\ *)
        kill -KILL "$vm"
        cut=${line#VM-CUT }
        ;;
    esac
    printf '%s\n' "$line" | tee -a "$from.console.txt"
    [ -z "$cut" ] || break
  done
  [ "$left" -gt 0 ] || say "the VM did not come to its end within its time, and is killed"
  kill -KILL "$vm" 2>/dev/null || true
  wait "$vm" 2>/dev/null || true
  vm=
  exec 7<&-
  say "VM ${cut:+(its power was cut) }$((SECONDS - begin)) s"
}
