// task_ping_pong: two goroutines that send each other a number a million times.
package main

import "fmt"

func main() {
	ping, pong := make(chan int), make(chan int)
	go func() {
		for value := range ping {
			pong <- value + 1
		}
	}()
	value := 0
	for i := 0; i < 1000000; i++ {
		ping <- value
		value = <-pong
	}
	fmt.Println(value)
}
