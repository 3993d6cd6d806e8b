" Programs in ESL, the Execution Support Language.
if exists("b:did_ftplugin")
  finish
endif
let b:did_ftplugin = 1

setlocal lisp expandtab shiftwidth=2 softtabstop=2
setlocal iskeyword=@,48-57,42,43,45,47,60,61,62,63,33,58,36,37,38,94,95,126
setlocal comments=:;;;;,:;;;,:;;,:; commentstring=;\ %s
setlocal define=^\\s*(def
setlocal formatprg=eslc\ format\ -
setlocal lispwords=defun,defmacro,defvar,defdurable,defparameter,defconstant,defstruct,defclass,defgeneric,defmethod
setlocal lispwords+=define-condition,define-cause,define-fluent,define-rule,define-property,define-mock
setlocal lispwords+=deftest,deftype,defpackage,let,let*,flet,labels,macrolet,symbol-macrolet,lambda,when
setlocal lispwords+=unless,case,ecase,typecase,etypecase,dolist,dotimes,do,do*,block,catch,eval-when
setlocal lispwords+=multiple-value-bind,destructuring-bind,unwind-protect,handler-case,handler-bind
setlocal lispwords+=restart-case,with-recovery-procedures,with-cleanup-procedure,with-timeout,with-budget
setlocal lispwords+=with-quota,with-guardian,with-resource,with-resources,with-maintained-property
setlocal lispwords+=with-maintained-properties,with-world,with-query-bindings,with-open-file,to-achieve
setlocal lispwords+=task-net,or-parallel,try-all,pursue,try-in-order,partial-order,supervise,spawn
setlocal lispwords+=whenever,do-every,without-interrupts,progn,fails,signals

let b:undo_ftplugin = "setlocal lisp< expandtab< shiftwidth< softtabstop< iskeyword< comments<"
      \ . " commentstring< define< formatprg< lispwords<"

" Neovim has a client of its own.
if has("nvim-0.7") && executable("eslc")
lua << END
  -- "Run test" above a test: in a terminal below.
  if vim.lsp.commands then
    vim.lsp.commands["esl.runTest"] = function(command)
      local file, test = vim.uri_to_fname(command.arguments[1]), command.arguments[2]
      vim.cmd("botright new")
      vim.fn.termopen({ "eslvm", "test", file, "--filter", test })
    end
  end
  local server = { name = "eslc", cmd = { "eslc", "lsp" }, root_dir = vim.fn.expand("%:p:h") }
  if vim.lsp.start then
    vim.lsp.start(server)
  else
    -- Before 0.8 one server is started here, and each file given to it.
    ESL_client = ESL_client or vim.lsp.start_client(server)
    vim.lsp.buf_attach_client(0, ESL_client)
  end
END
endif
