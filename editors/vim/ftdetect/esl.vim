autocmd BufRead,BufNewFile *.esl setfiletype esl
