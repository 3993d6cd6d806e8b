// task_spawn_join: a million goroutines, one after another, each created and awaited.
package main

import "fmt"

func main() {
	sum := 0
	done := make(chan int)
	for i := 0; i < 1000000; i++ {
		go func() { done <- i }()
		sum += <-done
	}
	fmt.Println(sum)
}
