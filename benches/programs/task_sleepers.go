// task_sleepers: a hundred thousand goroutines that sleep for a moment, ten times.
package main

import (
	"fmt"
	"sync"
	"time"
)

func main() {
	var all sync.WaitGroup
	all.Add(100000)
	for i := 0; i < 100000; i++ {
		pause := time.Duration(1+i%100) * 100 * time.Microsecond
		go func() {
			for turn := 0; turn < 10; turn++ {
				time.Sleep(pause)
			}
			all.Done()
		}()
	}
	all.Wait()
	fmt.Println(100000)
}
