// A program of Go on SocketCAN, statically linked, with the runtime's own poller and system calls: finds the interface, answers a
// number of frames of 0x3B0 with 0x3B1 in another goroutine, and ends.
package main

import (
	"encoding/binary"
	"fmt"
	"net"
	"os"
	"strconv"
	"syscall"
	"unsafe"
)

const (
	afCAN    = 29
	canRaw   = 1
	asked    = 0x3B0
	answered = 0x3B1
)

// The kernel's struct sockaddr_can.
type sockaddrCAN struct {
	family    uint16
	_         uint16
	interface_ int32
	_         [16]byte
}

func fail(what string, err error) {
	if err != nil {
		fmt.Fprintln(os.Stderr, what, err)
		os.Exit(1)
	}
}

func main() {
	count, err := strconv.Atoi(os.Args[2])
	fail("count:", err)
	named, err := net.InterfaceByName(os.Args[1])
	fail("interface:", err)
	fd, err := syscall.Socket(afCAN, syscall.SOCK_RAW|syscall.SOCK_CLOEXEC|syscall.SOCK_NONBLOCK, canRaw)
	fail("socket:", err)
	address := sockaddrCAN{family: afCAN, interface_: int32(named.Index)}
	_, _, errno := syscall.Syscall(syscall.SYS_BIND, uintptr(fd), uintptr(unsafe.Pointer(&address)), unsafe.Sizeof(address))
	if errno != 0 {
		fail("bind:", errno)
	}
	// Non-blocking, so that reads wait in the runtime's epoll.
	file := os.NewFile(uintptr(fd), "can")
	numbers := make(chan byte)
	done := make(chan bool)
	go func() {
		for number := range numbers {
			frame := make([]byte, 16)
			binary.LittleEndian.PutUint32(frame, answered)
			frame[4], frame[8] = 1, number
			_, err := file.Write(frame)
			fail("write:", err)
		}
		done <- true
	}()
	fmt.Println("bound to", named.Name, "mtu", named.MTU)
	for seen := 0; seen < count; {
		frame := make([]byte, 16)
		length, err := file.Read(frame)
		fail("read:", err)
		if length == 16 && binary.LittleEndian.Uint32(frame) == asked {
			numbers <- frame[8]
			seen++
		}
	}
	close(numbers)
	<-done
	fmt.Println("answered", count, "frames")
}
