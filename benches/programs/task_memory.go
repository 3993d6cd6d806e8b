// task_memory: a million goroutines that wait at the same time, then end.
package main

import "fmt"

func main() {
	event := make(chan struct{})
	values := make([]chan int, 1000000)
	for i := range values {
		done := make(chan int, 1)
		values[i] = done
		go func() { <-event; done <- 1 }()
	}
	close(event)
	sum := 0
	for _, done := range values {
		sum += <-done
	}
	fmt.Println(sum)
}
