// The reaction of a goroutine: see reaction.esl. There is nothing that compiles while it runs.
package main

import (
	"bufio"
	"fmt"
	"math/rand"
	"net"
	"os"
	"strconv"
	"time"
)

type cell struct{ first, rest *cell }

var live []*cell
var kept *cell

func list(length int) *cell {
	var all *cell
	for i := 0; i < length; i++ {
		all = &cell{nil, all}
	}
	return all
}

func fibonacci(n int) int {
	if n < 2 {
		return n
	}
	return fibonacci(n-1) + fibonacci(n-2)
}

// A tenth of the time.
func compute() {
	for {
		for end := time.Now().Add(4 * time.Millisecond); time.Now().Before(end); {
			fibonacci(15)
		}
		time.Sleep(46 * time.Millisecond)
	}
}

// At most 1 GB a second.
func allocate() {
	for i := 0; i < 1000; i++ {
		live = append(live, list(6250))
	}
	begin, bytes := time.Now(), 0
	for {
		for i := 0; i < 64; i++ {
			kept = list(1000)
		}
		bytes += 1024000
		ahead := time.Duration(bytes) - time.Since(begin)
		if ahead > time.Millisecond {
			time.Sleep(ahead)
		}
	}
}

func load(beside string) {
	switch beside {
	case "compute":
		for i := 0; i < 10; i++ {
			go compute()
		}
	case "allocate":
		go allocate()
	case "tasks":
		for i := 0; i < 100000; i++ {
			go func() {
				for {
					time.Sleep(time.Second + time.Duration(rand.Int63n(9_000_000_000)))
				}
			}()
		}
	}
}

func timerDelays(delays []int64) {
	next := time.Now().Add(100 * time.Millisecond)
	for i := range delays {
		time.Sleep(time.Until(next))
		late := time.Since(next)
		delays[i] = late.Nanoseconds()
		missed := late.Milliseconds()
		next = next.Add(time.Duration(1+missed) * time.Millisecond)
	}
}

func inputDelays(delays []int64, port int) {
	socket, err := net.ListenUDP("udp", &net.UDPAddr{IP: net.IPv4(127, 0, 0, 1), Port: port})
	if err != nil {
		panic(err)
	}
	data := make([]byte, 100)
	for i := range delays {
		n, _, err := socket.ReadFromUDP(data)
		if err != nil {
			panic(err)
		}
		sent, _ := strconv.ParseInt(string(data[:n]), 10, 64)
		delays[i] = time.Now().UnixNano() - sent
	}
}

func main() {
	count, _ := strconv.Atoi(os.Args[3])
	delays := make([]int64, count)
	done := make(chan bool)
	go func() {
		time.Sleep(2 * time.Second)
		if os.Args[1] == "timer" {
			timerDelays(delays)
		} else {
			port, _ := strconv.Atoi(os.Args[4])
			inputDelays(delays, port)
		}
		done <- true
	}()
	load(os.Args[2])
	<-done
	out := bufio.NewWriter(os.Stdout)
	for _, delay := range delays {
		fmt.Fprintln(out, delay)
	}
	out.Flush()
}
